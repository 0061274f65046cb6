"""Poses drawn from p(x | z), compiled; see `homsense.resetting`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from homsense import resetting
from homsense.compiled.exact import HALF, words
from homsense.compiled.jit import allocating, inlined
from homsense.compiled.stages import linear
from homsense.philox import Purpose

Array = NDArray[Any]

_WORD = resetting.WORD
_NOTHING = np.int32(0)
_RELOCATION = int(Purpose.RELOCATION)


@allocating
def cell_masses(sizes: Array, table: Array) -> tuple[Array, float, int]:
    """Return where a measurement can have been made.

    Parameters
    ----------
    sizes : ndarray, shape (n_codes,), float64
        How many free cells have each code.
    table : ndarray, shape (n_codes,), int32
        Log-likelihood of each code.

    Returns
    -------
    of_code : ndarray, shape (n_codes,), float64
        Masses.
    total : float
        Their sum; all are whole numbers, so any order of summing gives the same.
    best : int
        The highest log-likelihood.
    """
    best, total = table[1], 0.0
    for code in range(1, len(table)):
        best = max(best, table[code])
    of_code = np.empty(len(table), np.float64)
    for code in range(len(table)):
        of_code[code] = linear(min(np.int32(table[code] - best), _NOTHING)) * sizes[code]
        total += of_code[code]
    return of_code, total, best


@allocating
def draw(
    sizes: Array,
    cells: Array,
    starts: Array,
    of_code: Array,
    grid: tuple[float, float, float, int],
    key: tuple[int, int],
    count: int,
) -> tuple[Array, Array, Array, Array]:
    """Draw poses: a code by its mass, then one of its cells.

    Parameters
    ----------
    sizes, cells, starts : ndarray
        As in `homsense.resetting.CodedCells`.
    of_code : ndarray, shape (n_codes,), float64
        Masses.
    grid : tuple
        West m, south m, cell m, columns.
    key : tuple of uint64
        Seed and tick.
    count : int
        How many.

    Returns
    -------
    tuple of ndarray
        The four arrays of the drawn particles.
    """
    west_m, south_m, cell_m, columns = grid
    reached = np.cumsum(of_code)
    drawn = words(key[0], key[1], _RELOCATION, 2 * count)
    which, place = drawn[:, :count], drawn[:, count:]
    x, y = np.empty(count, np.float32), np.empty(count, np.float32)
    turns, log_weight = np.empty(count, np.float32), np.zeros(count, np.int32)
    scale = _WORD * reached[-1]
    for index in range(count):
        code = _first_above(reached, np.float64(which[0, index]) * scale)
        nth = np.int64(np.float64(which[1, index]) * (_WORD * sizes[code]))
        cell = cells[starts[code] + nth]
        row, column = cell // columns, cell % columns
        x[index] = west_m + cell_m * (column + np.float64(place[0, index]) * _WORD)
        y[index] = south_m + cell_m * (row + np.float64(place[1, index]) * _WORD)
        turns[index] = np.float32(np.float64(which[2, index]) * _WORD) - HALF
    return x, y, turns, log_weight


@inlined
def _first_above(rising: Array, number: float) -> int:
    low, high = 0, len(rising)
    while low < high:
        middle = (low + high) >> 1
        if rising[middle] > number:
            high = middle
        else:
            low = middle + 1
    return low
