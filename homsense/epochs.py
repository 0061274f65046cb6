"""Expiry: one filtration for each epoch, such as a week, and their union.

Nothing can be deleted inside a filtration, since nobody knows who else saw the same; an epoch
can be left out of the union.
"""

from collections.abc import Iterable, Mapping
from functools import reduce
from operator import or_
from types import MappingProxyType
from typing import Self

from homsense.engine import Engine
from homsense.witness import WitnessFiltration


class EpochFiltration:
    """The witness filtration of some epochs, any of which can be forgotten.

    A value: versions are never changed by what is observed or forgotten later.

    Parameters
    ----------
    empty : WitnessFiltration
        What an epoch starts from: decides depth and engine.

    Examples
    --------
    >>> weeks = EpochFiltration(WitnessFiltration()).with_observations(
    ...     [(1, "ann", {"a", "b"}), (2, "ann", {"b", "c"}), (2, "bob", {"a", "c"})]
    ... )
    >>> weeks.merged.level(1).betti_numbers(), weeks.since(2).merged.level(1).betti_numbers()
    ((1, 1), (1, 0))
    """

    __slots__ = ("_empty", "_epochs", "_merged")

    def __init__(
        self,
        empty: WitnessFiltration,
        epochs: Mapping[int, WitnessFiltration] = MappingProxyType({}),
        merged: WitnessFiltration | None = None,
    ) -> None:
        self._empty = empty
        self._epochs = epochs
        self._merged = merged if merged is not None else reduce(or_, epochs.values(), empty)

    @property
    def merged(self) -> WitnessFiltration:
        """The filtration of all that was observed in the epochs that are kept."""
        return self._merged

    @property
    def epochs(self) -> list[int]:
        """The epochs that are kept, rising."""
        return sorted(self._epochs)

    def epoch(self, number: int) -> WitnessFiltration:
        """Return the filtration of one epoch.

        Parameters
        ----------
        number : int
            One of `epochs`.

        Returns
        -------
        WitnessFiltration
            What was observed in it.
        """
        return self._epochs[number]

    def with_observations(self, observations: Iterable[tuple[int, str, Iterable[str]]]) -> Self:
        """Return the filtration with more observations.

        Parameters
        ----------
        observations : iterable of (int, str, iterable of str)
            In which epoch, who saw, and which landmarks.

        Returns
        -------
        EpochFiltration
            A new version; this one stays valid.
        """
        by_epoch: dict[int, list[tuple[str, frozenset[str]]]] = {}
        for epoch, witness, landmarks in observations:
            by_epoch.setdefault(epoch, []).append((witness, frozenset(landmarks)))
        epochs, merged = dict(self._epochs), self._merged
        for epoch, seen in by_epoch.items():
            alone = not epochs or epochs.keys() == {epoch}
            epochs[epoch] = epochs.get(epoch, self._empty).with_observations(seen)
            merged = epochs[epoch] if alone else merged.with_observations(seen)
        return type(self)(self._empty, epochs, merged)

    def run_by(self, engine: Engine) -> Self:
        """Return the same filtration, run by another engine.

        Parameters
        ----------
        engine : Engine
            What runs the hot loops from now on.

        Returns
        -------
        EpochFiltration
            Equal to this one.
        """
        epochs = {number: seen.run_by(engine) for number, seen in self._epochs.items()}
        return type(self)(self._empty.run_by(engine), epochs, self._merged.run_by(engine))

    def since(self, epoch: int) -> Self:
        """Return the filtration without the epochs before one.

        Parameters
        ----------
        epoch : int
            The first one that is kept.

        Returns
        -------
        EpochFiltration
            A new version, or this very one when there is nothing to forget.
        """
        kept = {number: seen for number, seen in self._epochs.items() if number >= epoch}
        return self if len(kept) == len(self._epochs) else type(self)(self._empty, kept)
