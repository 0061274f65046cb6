"""Poses drawn from p(x | z), wherever the particles are (sensor resetting; Lenser, Veloso 2000).

`homsense.compiled.resetting` repeats this operation by operation; the results have the same bits.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from homsense.exact import HALF
from homsense.grid import Grid
from homsense.particles import Particles
from homsense.philox import Purpose, random_words
from homsense.weights import UNITS_PER_BIT, bits, linear

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
Integers = NDArray[np.int32]

WORD = 2.0**-32


class CodedCells(NamedTuple):
    """Free cells, sorted by code.

    Parameters
    ----------
    grid : Grid
        Where the cells lie.
    sizes : ndarray, shape (n_codes,), float64
        How many free cells have each code; none has code 0.
    cells : ndarray, shape (n_free,), intp
        The free cells, by flat index.
    starts : ndarray, shape (n_codes,), intp
        Where the cells of each code begin in `cells`.
    """

    grid: Grid
    sizes: FloatArray
    cells: IntArray
    starts: IntArray


class CellMasses(NamedTuple):
    """How much of the likelihood of a measurement lies on the cells of each code.

    Parameters
    ----------
    of_code : ndarray, shape (n_codes,), float64
        Whole numbers; 2**20 for each cell of the code that explains best.
    evidence_bits : float
        Binary logarithm of the mean likelihood over all free space.
    """

    of_code: FloatArray
    evidence_bits: float


def cell_masses(coded: CodedCells, table: Integers) -> CellMasses:
    """Return where a measurement can have been made.

    Parameters
    ----------
    coded : CodedCells
        The cells.
    table : ndarray, shape (n_codes,), int32
        Log-likelihood of each code.

    Returns
    -------
    CellMasses
        Of all free space.
    """
    best = int(table[1:].max())
    likelihood = linear(np.minimum(table - np.int32(best), np.int32(0)))
    of_code = likelihood * coded.sizes
    return CellMasses(of_code, evidence_bits(coded, float(of_code.sum()), best))


def evidence_bits(coded: CodedCells, total: float, best: int) -> float:
    """Return the binary logarithm of the mean likelihood over all free space.

    Parameters
    ----------
    coded : CodedCells
        The cells.
    total : float
        Sum of the masses.
    best : int
        Log-likelihood that a mass of 2**20 stands for.

    Returns
    -------
    float
        Of the measurement.
    """
    return best / UNITS_PER_BIT + bits(total / len(coded.cells))


def draw(coded: CodedCells, masses: CellMasses, seed: int, tick: int, count: int) -> Particles:
    """Draw poses from p(x | z): a code by its mass, then one of its cells.

    Parameters
    ----------
    coded : CodedCells
        The cells.
    masses : CellMasses
        Of the measurement.
    seed, tick : int
        Key of the random numbers, in [0, 2**64).
    count : int
        How many.

    Returns
    -------
    Particles
        Of equal weight and any heading.
    """
    words = random_words(seed, tick, Purpose.RELOCATION, 2 * count)
    which, place = words[:, :count], words[:, count:]
    reached = np.cumsum(masses.of_code)
    code = np.searchsorted(reached, which[0] * (WORD * reached[-1]), side="right")
    nth = (which[1] * (WORD * coded.sizes[code])).astype(np.int64)
    cells = coded.cells[coded.starts[code] + nth]
    x, y = coded.grid.within(cells, place[0], place[1])
    turns = (which[2] * WORD).astype(np.float32) - HALF
    return Particles(x, y, turns, np.zeros(len(x), np.int32))
