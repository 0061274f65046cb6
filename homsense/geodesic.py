"""Free-space distances on a grid: how far a device has to walk around the structures."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

from homsense.grid import Grid

BoolArray = NDArray[np.bool_]
FloatArray = NDArray[np.float64]

_MOVES = ((0, 1), (1, 0), (1, 1), (1, -1), (1, 2), (2, 1), (1, -2), (2, -1))
_BATCH = 32


def free_space_graph(grid: Grid, free: BoolArray) -> sparse.csr_array:
    """Return the graph of moves between free cells.

    The sixteen moves of king and knight are allowed where all cells that they cross are free;
    path lengths exceed the true ones by at most 2.8 %.

    Parameters
    ----------
    grid : Grid
        The raster.
    free : ndarray, shape (rows, columns), bool
        Cells where a device can be.

    Returns
    -------
    scipy.sparse.csr_array, shape (rows * columns, rows * columns), float64
        Lengths of the moves, metres; each move once.
    """
    rows, columns = grid.shape
    number = np.arange(rows * columns).reshape(rows, columns)
    starts, ends, lengths = [], [], []
    for move in _MOVES:
        here = _window(grid.shape, move, (0, 0))
        open_cells = free[here].copy()
        for crossed in _crossed(*move):
            open_cells &= free[_window(grid.shape, move, crossed)]
        start = number[here][open_cells]
        up, right = move
        starts.append(start)
        ends.append(start + up * columns + right)
        lengths.append(np.full(len(start), grid.cell_m * float(np.hypot(up, right))))
    entries = (np.concatenate(lengths), (np.concatenate(starts), np.concatenate(ends)))
    return sparse.csr_array(entries, shape=(rows * columns, rows * columns))


def _window(
    shape: tuple[int, int], move: tuple[int, int], offset: tuple[int, int]
) -> tuple[slice, slice]:
    """Return the cells at an offset from those from which a move stays on the grid."""
    (rows, columns), (up, right) = shape, move
    south, west = offset[0], max(0, -right) + offset[1]
    return slice(south, south + rows - up), slice(west, west + columns - abs(right))


def _crossed(up: int, right: int) -> tuple[tuple[int, int], ...]:
    """Return the cells that a move enters or passes between, relative to its start."""
    if abs(up) + abs(right) == 1:
        return ((up, right),)
    side = 1 if right > 0 else -1
    if abs(up) == abs(right):
        return ((up, right), (up, 0), (0, right))
    if abs(right) > abs(up):
        return ((up, right), (0, side), (up, side))
    return ((up, right), (1, 0), (1, right))


def distances_from(
    grid: Grid, graph: sparse.csr_array, free: BoolArray, sources: FloatArray, limit_m: float
) -> Iterator[FloatArray]:
    """Yield, for each source, the free-space distance of every cell.

    Parameters
    ----------
    grid : Grid
        The raster.
    graph : scipy.sparse.csr_array
        From `free_space_graph`.
    free : ndarray, shape (rows, columns), bool
        Cells where a device can be.
    sources : ndarray, shape (M, 2), float64
        Places on the faces of structures, metres.
    limit_m : float
        Greatest distance of interest, metres; beyond it the answer is infinite.

    Yields
    ------
    ndarray, shape (rows * columns,), float64
        Metres.
    """
    free_cells = np.flatnonzero(free.ravel())
    centers = grid.centers()[free_cells]
    reach = 2.0 * grid.cell_m
    for first in range(0, len(sources), _BATCH):
        batch = sources[first : first + _BATCH]
        gaps = np.linalg.norm(batch[:, None] - centers[None], axis=2)
        which, near = np.nonzero(gaps <= reach)
        joined = _with_sources(graph, which, free_cells[near], gaps[which, near], len(batch))
        start = graph.shape[0] + np.arange(len(batch))
        found = dijkstra(joined, directed=False, indices=start, limit=limit_m)
        yield from found[:, : graph.shape[0]]


def _with_sources(
    graph: sparse.csr_array,
    which: NDArray[np.intp],
    cells: NDArray[np.intp],
    lengths: FloatArray,
    count: int,
) -> sparse.csr_array:
    """Append one node for each source, joined with the cells around it."""
    moves = graph.tocoo()
    total = graph.shape[0] + count
    starts = np.concatenate([moves.row, graph.shape[0] + which])
    ends = np.concatenate([moves.col, cells])
    data = np.concatenate([moves.data, np.maximum(lengths, 1e-9)])
    return sparse.csr_array((data, (starts, ends)), shape=(total, total))
