"""Which code runs the hot loops: the reference in Python, or the same compiled by numba."""

from collections.abc import Callable, Sequence
from functools import cache
from importlib import import_module
from typing import NamedTuple

import numpy as np

from homsense import insertion, neighborhood
from homsense.facet_table import FacetTable, Numbers, Ragged, Version
from homsense.history import History, history
from homsense.neighborhood import Neighborhoods


class Engine(NamedTuple):
    """The three hot loops; every engine gives the same results.

    Parameters
    ----------
    name : str
        ``"python"`` or ``"numba"``.
    insert : callable
        Joins scans into a facet table.
    sense : callable
        Finds hop neighborhoods and counts their holes.
    history : callable
        Counts the holes of a growing sequence of complexes.
    """

    name: str
    insert: Callable[[FacetTable, Ragged], None]
    sense: Callable[[FacetTable, Version, Numbers, Sequence[int], Numbers], Neighborhoods]
    history: Callable[[Ragged, Sequence[int]], History]


PYTHON = Engine("python", insertion.insert, neighborhood.sense, history)


@cache
def compiled() -> Engine | None:
    """Return the engine that numba compiles when it is first used.

    Returns
    -------
    Engine or None
        None when numba is not installed (it comes with ``homsense[fast]``).
    """
    try:
        kernels = import_module("homsense.compiled.kernels")
    except ImportError:
        return None
    return Engine("numba", kernels.insert, kernels.sense, kernels.history)


def warmed() -> Engine:
    """Return the compiled engine after it has compiled everything, which may take half a minute.

    Returns
    -------
    Engine
        The reference when numba is not installed.
    """
    engine = fastest()
    table = FacetTable()
    seeds = np.array([table.number("warm")], np.int32)
    engine.insert(table, Ragged.of([[0]]))
    engine.sense(table, table.version(), seeds, [0], seeds[:0])
    engine.history(Ragged.of([[0]]), [1])
    return engine


def fastest() -> Engine:
    """Return the compiled engine where it can be had, else the reference.

    Returns
    -------
    Engine
        What a complex uses unless told otherwise.
    """
    return compiled() or PYTHON
