"""Slow and independent answers."""

from collections.abc import Iterable
from itertools import combinations

import gudhi
import networkx as nx


def all_faces(simplices: Iterable[frozenset[str]]) -> set[frozenset[str]]:
    """List every face."""
    return {
        frozenset(face)
        for simplex in simplices
        for size in range(1, len(simplex) + 1)
        for face in combinations(sorted(simplex), size)
    }


def gudhi_betti(simplices: Iterable[frozenset[str]]) -> tuple[int, int]:
    """Return (b0, b1) over GF(2) as GUDHI has them."""
    faces = all_faces(simplices)
    number = {vertex: n for n, vertex in enumerate(sorted({v for face in faces for v in face}))}
    tree = gudhi.SimplexTree()
    for face in faces:
        if len(face) <= 3:
            tree.insert([number[vertex] for vertex in face])
    if not faces:
        return 0, 0
    tree.compute_persistence(
        homology_coeff_field=2, min_persistence=-1.0, persistence_dim_max=True
    )
    betti = [*tree.betti_numbers(), 0, 0]
    return betti[0], betti[1]


def gudhi_rank(smaller: Iterable[frozenset[str]], larger: Iterable[frozenset[str]]) -> int:
    """Return the rank of H_1 of a complex in that of one that holds it, as GUDHI has it."""
    first, second = all_faces(smaller), all_faces(larger)
    number = {vertex: n for n, vertex in enumerate(sorted({v for face in second for v in face}))}
    tree = gudhi.SimplexTree()
    for face in second:
        if len(face) <= 3:
            tree.insert([number[vertex] for vertex in face], 0.0 if face in first else 1.0)
    if not second:
        return 0
    bars = tree.persistence(homology_coeff_field=2, min_persistence=-1.0, persistence_dim_max=True)
    return sum(degree == 1 and birth == 0.0 and death > 1.0 for degree, (birth, death) in bars)


def maximal_sets(simplices: Iterable[frozenset[str]]) -> frozenset[frozenset[str]]:
    """Return the sets that no other one contains."""
    distinct = {simplex for simplex in simplices if simplex}
    return frozenset(s for s in distinct if not any(s < other for other in distinct))


def metric_ball(
    simplices: Iterable[frozenset[str]],
    start: set[str],
    radius_m: float,
    range_m: dict[str, float],
) -> set[str]:
    """Return the ball where an edge is as long as the mean range of its ends."""
    graph: nx.Graph[str] = nx.Graph()
    for simplex in simplices:
        graph.add_nodes_from(simplex)
        for a, b in combinations(sorted(simplex), 2):
            graph.add_edge(a, b, weight=(range_m[a] + range_m[b]) / 2)
    known = start & set(graph)
    if not known:
        return set()
    lengths = nx.multi_source_dijkstra_path_length(graph, known, cutoff=radius_m)
    return set(lengths)


def hop_ball(simplices: Iterable[frozenset[str]], start: set[str], radius: int) -> set[str]:
    """Return the ball in the 1-skeleton by shortest paths."""
    graph: nx.Graph[str] = nx.Graph()
    for simplex in simplices:
        graph.add_nodes_from(simplex)
        graph.add_edges_from(combinations(sorted(simplex), 2))
    ball: set[str] = set()
    for vertex in start & set(graph):
        ball |= set(nx.single_source_shortest_path_length(graph, vertex, cutoff=radius))
    return ball


def faces_by_witnesses(
    observations: Iterable[tuple[str, frozenset[str]]], witnesses: int
) -> set[frozenset[str]]:
    """List every face that enough distinct witnesses have seen."""
    seen: dict[frozenset[str], set[str]] = {}
    for witness, scan in observations:
        for face in all_faces([scan]):
            seen.setdefault(face, set()).add(witness)
    return {face for face, by in seen.items() if len(by) >= witnesses}
