"""Filtrations as plain lists and arrays, to be kept outside the process and built again."""

from collections.abc import Mapping
from typing import NamedTuple

from homsense.engine import Engine
from homsense.epochs import EpochFiltration
from homsense.facet_table import FacetTable, Ragged
from homsense.simplicial import LandmarkComplex
from homsense.witness import WitnessFiltration


class PlainComplex(NamedTuple):
    """A landmark complex.

    Parameters
    ----------
    landmarks : list of str
        By number.
    facets : Ragged
        Numbers of the landmarks of each facet, rising.
    """

    landmarks: list[str]
    facets: Ragged


class PlainFiltration(NamedTuple):
    """A filtration by epochs and witnesses.

    Parameters
    ----------
    epochs : mapping of int to tuple of PlainComplex
        The parts of each epoch's filtration.
    merged : tuple of PlainComplex
        Those of their union.
    """

    epochs: Mapping[int, tuple[PlainComplex, ...]]
    merged: tuple[PlainComplex, ...]


def to_plain(filtration: EpochFiltration) -> PlainFiltration:
    """Return a filtration as plain lists and arrays.

    Parameters
    ----------
    filtration : EpochFiltration
        Any version.

    Returns
    -------
    PlainFiltration
        As large as its facets.

    Examples
    --------
    >>> seen = [(1, "ann", {"a", "b"}), (2, "bob", {"b", "c"})]
    >>> weeks = EpochFiltration(WitnessFiltration(depth=2)).with_observations(seen)
    >>> again = from_plain(to_plain(weeks))
    >>> again.merged.digest() == weeks.merged.digest()
    True
    """
    epochs = {number: _plain_parts(filtration.epoch(number)) for number in filtration.epochs}
    return PlainFiltration(epochs, _plain_parts(filtration.merged))


def from_plain(plain: PlainFiltration, engine: Engine | None = None) -> EpochFiltration:
    """Return the filtration that was made plain.

    Parameters
    ----------
    plain : PlainFiltration
        From `to_plain`.
    engine : Engine, optional
        What runs the hot loops; the fastest by default.

    Returns
    -------
    EpochFiltration
        Equal to the one it is from, and grows as that one would.
    """
    merged = _filtration(plain.merged, engine)
    empty = WitnessFiltration(merged.depth, engine)
    epochs = {number: _filtration(parts, engine) for number, parts in plain.epochs.items()}
    return EpochFiltration(empty, epochs, merged)


def _plain_parts(filtration: WitnessFiltration) -> tuple[PlainComplex, ...]:
    return tuple(
        PlainComplex(part.numbered, part.version.rows(part.version.live()))
        for part in filtration.parts
    )


def _filtration(parts: tuple[PlainComplex, ...], engine: Engine | None) -> WitnessFiltration:
    tables = (FacetTable.of(part.facets, part.landmarks) for part in parts)
    return WitnessFiltration.of_parts([LandmarkComplex(engine, table) for table in tables])
