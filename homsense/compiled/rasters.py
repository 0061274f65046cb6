"""Which cell of a raster holds a place, compiled."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from homsense.compiled.jit import apart, inlined
from homsense.grid import Raster

Array = NDArray[Any]

_NOTHING = np.float32(0.0)


@apart
def find_cells(raster: Raster, x_m: Array, y_m: Array, cells: Array) -> None:
    """Find the cells of some places.

    Parameters
    ----------
    raster : Raster
        The cells.
    x_m, y_m : ndarray, shape (N,), float32
        Places, metres; beyond the edge they count as on it.
    cells : ndarray, shape (N,), uint32
        Gets the flat indices.
    """
    for index in range(len(cells)):
        cells[index] = cell_at(raster, x_m[index], y_m[index])


@inlined
def cell_at(raster: Raster, x_m: Any, y_m: Any) -> Any:
    """Return the flat index of a cell, unsigned."""
    last_column, last_row = np.float32(raster.columns - 1), np.float32(raster.rows - 1)
    column = min(max((x_m - raster.west_m) * raster.cells_per_m, _NOTHING), last_column)
    row = min(max((y_m - raster.south_m) * raster.cells_per_m, _NOTHING), last_row)
    return np.uint32(np.int32(row) * np.int32(raster.columns) + np.int32(column))
