"""The explicit chain complex: boundary matrices, Laplacians and Betti numbers in any degree.

Faces are listed here, on request and below a limit, for small complexes and as a reference.
"""

from collections.abc import Collection, Iterable
from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from homsense.errors import ComputationLimitError, InvalidComplexError

MAX_FACES = 200_000

Face = tuple[str, ...]


def faces(
    facets: Iterable[Collection[str]], degree: int, *, max_faces: int = MAX_FACES
) -> list[Face]:
    """List the faces of one degree in lexicographic order.

    Parameters
    ----------
    facets : iterable of collection of str
        Generating simplices.
    degree : int
        Dimension of the faces; those of degree -1 and below are none.
    max_faces : int, optional
        Most faces that may be listed.

    Returns
    -------
    list of tuple of str
        Sorted vertex tuples.

    Raises
    ------
    ComputationLimitError
        If there may be more faces than allowed.

    Examples
    --------
    >>> faces([{"a", "b"}, {"b", "c"}], 1)
    [('a', 'b'), ('b', 'c')]
    """
    if degree < 0:
        return []
    generators = list(facets)
    bound = sum(comb(len(facet), degree + 1) for facet in generators)
    if bound > max_faces:
        message = f"{bound} faces of degree {degree} are more than the limit of {max_faces}"
        raise ComputationLimitError(message)
    found: set[Face] = set()
    for facet in generators:
        found.update(combinations(sorted(facet), degree + 1))
    return sorted(found)


def boundary_matrix(
    facets: Iterable[Collection[str]], degree: int, *, max_faces: int = MAX_FACES
) -> sparse.csr_array:
    """Return the boundary homomorphism from degree-chains to (degree - 1)-chains.

    Parameters
    ----------
    facets : iterable of collection of str
        Generating simplices.
    degree : int
        Degree of the chains that are mapped.
    max_faces : int, optional
        Most faces that may be listed in one degree.

    Returns
    -------
    scipy.sparse.csr_array, shape (n_faces(degree - 1), n_faces(degree)), int64
        Entries -1, 0, 1; faces are oriented by vertex order (paper, section III-B).

    Examples
    --------
    >>> boundary_matrix([{"a", "b"}], 1).toarray().tolist()
    [[-1], [1]]
    """
    generators = list(facets)
    columns = faces(generators, degree, max_faces=max_faces)
    rows = {
        face: row for row, face in enumerate(faces(generators, degree - 1, max_faces=max_faces))
    }
    entries = [
        (rows[face[:omitted] + face[omitted + 1 :]], column, (-1) ** omitted)
        for column, face in enumerate(columns if rows else [])
        for omitted in range(degree + 1)
    ]
    at_row, at_column, signs = np.array(entries, dtype=np.int64).reshape(-1, 3).T
    shape = (len(rows), len(columns))
    return sparse.csr_array((signs, (at_row, at_column)), shape=shape)


def laplacian(
    facets: Iterable[Collection[str]], degree: int, *, max_faces: int = MAX_FACES
) -> NDArray[np.int64]:
    """Return the combinatorial Laplacian of a degree.

    Parameters
    ----------
    facets : iterable of collection of str
        Generating simplices.
    degree : int
        Degree k, not negative.
    max_faces : int, optional
        Most faces that may be listed in one degree.

    Returns
    -------
    ndarray, shape (n_faces, n_faces), int64
        ``boundary_k.T @ boundary_k + boundary_k+1 @ boundary_k+1.T`` (paper, section V-B.2).

    Raises
    ------
    InvalidComplexError
        If the degree is negative.
    """
    if degree < 0:
        message = f"a Laplacian has a degree of at least 0, not {degree}"
        raise InvalidComplexError(message, "degree")
    generators = list(facets)
    down = boundary_matrix(generators, degree, max_faces=max_faces)
    up = boundary_matrix(generators, degree + 1, max_faces=max_faces)
    dense: NDArray[np.int64] = (down.T @ down + up @ up.T).toarray()
    return dense


def laplacian_kernel_dimension(
    facets: Iterable[Collection[str]], degree: int, *, max_faces: int = MAX_FACES
) -> int:
    """Return the dimension of the kernel of the Laplacian: the real Betti number of the degree.

    Parameters
    ----------
    facets : iterable of collection of str
        Generating simplices.
    degree : int
        Degree k, not negative.
    max_faces : int, optional
        Most faces that may be listed in one degree; the spectrum costs the cube of their number.

    Returns
    -------
    int
        Number of independent degree-dimensional holes over the reals.

    Examples
    --------
    >>> laplacian_kernel_dimension([{"a", "b"}, {"b", "c"}, {"a", "c"}], 1)
    1
    """
    matrix = laplacian(facets, degree, max_faces=max_faces)
    if matrix.size == 0:
        return 0
    spectrum = np.linalg.eigvalsh(matrix.astype(np.float64))
    tolerance = 1e-9 * len(spectrum) * max(1.0, float(spectrum[-1]))
    return int(np.count_nonzero(np.abs(spectrum) < tolerance))


def betti_numbers(
    facets: Iterable[Collection[str]], max_degree: int, *, max_faces: int = MAX_FACES
) -> tuple[int, ...]:
    """Return the Betti numbers over GF(2) from degree 0 to a degree, from the listed faces.

    Parameters
    ----------
    facets : iterable of collection of str
        Generating simplices.
    max_degree : int
        Highest degree wanted.
    max_faces : int, optional
        Most faces that may be listed in one degree.

    Returns
    -------
    tuple of int
        ``dim ker boundary_k - dim im boundary_k+1`` for each k (paper, equation 1).

    Examples
    --------
    >>> betti_numbers([{"a", "b", "c"}, {"b", "c", "d"}, {"a", "c", "d"}, {"a", "b", "d"}], 2)
    (1, 0, 1)
    """
    generators = list(facets)
    sizes = [
        len(faces(generators, degree, max_faces=max_faces)) for degree in range(max_degree + 1)
    ]
    ranks = [0] + [
        _rank_gf2(boundary_matrix(generators, degree, max_faces=max_faces))
        for degree in range(1, max_degree + 2)
    ]
    return tuple(size - ranks[degree] - ranks[degree + 1] for degree, size in enumerate(sizes))


def _rank_gf2(matrix: sparse.csr_array) -> int:
    """Return the rank over GF(2) by elimination on integers as bit rows."""
    pivots: dict[int, int] = {}
    for start, stop in zip(matrix.indptr[:-1], matrix.indptr[1:], strict=True):
        row = 0
        for column in matrix.indices[start:stop]:
            row ^= 1 << int(column)
        while row:
            lead = row.bit_length()
            if lead not in pivots:
                pivots[lead] = row
                break
            row ^= pivots[lead]
    return len(pivots)
