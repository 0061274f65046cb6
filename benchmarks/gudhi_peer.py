"""GUDHI's answer to a local hole count, in its best case: edges and triangles are given to it."""

from itertools import combinations
from typing import Any

import gudhi
import numba
import numpy as np
from numpy.typing import NDArray

from homsense import LandmarkComplex

Array = NDArray[Any]


def two_skeleton(local: LandmarkComplex) -> tuple[Array, Array, Array]:
    """Return vertices, edges and triangles of a complex, one column each, without repetition."""
    number = {landmark: n for n, landmark in enumerate(sorted(local.landmarks))}
    inside = np.zeros((local.n_facets, len(number)), np.bool_)
    for row, facet in enumerate(local.facets):
        inside[row, [number[landmark] for landmark in facet]] = True
    packed = np.packbits(inside, axis=1, bitorder="little")
    words = np.zeros((len(packed), -(-len(number) // 64) * 8), np.uint8)
    words[:, : packed.shape[1]] = packed
    edges, triangles = _cofaces(words.view(np.uint64), np.ascontiguousarray(inside.T))
    return np.arange(len(number), dtype=np.int32)[None], edges.T, triangles.T


def betti(skeleton: tuple[Array, Array, Array]) -> tuple[int, int]:
    """Return (b0, b1) over GF(2)."""
    tree = gudhi.SimplexTree()
    for faces in skeleton:
        if faces.shape[1]:
            tree.insert_batch(faces, np.zeros(faces.shape[1]))
    tree.compute_persistence(
        homology_coeff_field=2,
        min_persistence=-1.0,
        persistence_dim_max=not skeleton[2].shape[1],
    )
    found = [*tree.betti_numbers(), 0, 0]
    return found[0], found[1]


@numba.njit(cache=True)
def _cofaces(words: Array, inside: Array) -> tuple[Array, Array]:  # noqa: C901 - a triple loop
    n_vertices, n_facets = inside.shape
    edges = np.empty((1024, 2), np.int32)
    triangles = np.empty((1024, 3), np.int32)
    n_edges = n_triangles = 0
    common = np.empty(words.shape[1], np.uint64)
    for u in range(n_vertices):
        for v in range(u + 1, n_vertices):
            common[:] = np.uint64(0)
            met = False
            for facet in range(n_facets):
                if inside[u, facet] and inside[v, facet]:
                    met = True
                    for word in range(len(common)):
                        common[word] |= words[facet, word]
            if not met:
                continue
            if n_edges == len(edges):
                edges = np.concatenate((edges, np.empty_like(edges)))
            edges[n_edges] = u, v
            n_edges += 1
            for w in range(v + 1, n_vertices):
                if common[w >> 6] >> np.uint64(w & 63) & np.uint64(1):
                    if n_triangles == len(triangles):
                        triangles = np.concatenate((triangles, np.empty_like(triangles)))
                    triangles[n_triangles] = u, v, w
                    n_triangles += 1
    return edges[:n_edges], triangles[:n_triangles]


def rank(smaller: list[list[int]], larger: list[list[int]]) -> int:
    """Return the rank of H_1 of a complex in that of a larger one, from generating simplices."""
    values: dict[tuple[int, ...], float] = {}
    for value, generators in ((0.0, smaller), (1.0, larger)):
        for simplex in generators:
            for size in (1, 2, 3):
                for face in combinations(sorted(simplex), size):
                    values.setdefault(face, value)
    tree = gudhi.SimplexTree()
    for face, value in sorted(values.items(), key=lambda entry: (entry[1], len(entry[0]))):
        tree.insert(face, value)
    if not values:
        return 0
    bars = tree.persistence(homology_coeff_field=2, min_persistence=-1.0, persistence_dim_max=True)
    return sum(degree == 1 and birth == 0.0 and death > 1.0 for degree, (birth, death) in bars)
