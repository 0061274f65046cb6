"""The landmark complex by witnesses: how many distinct devices saw the same landmarks together.

K_m holds the simplices that at least m distinct witnesses have seen, so K_1 is the landmark
complex and each K_m+1 lies in K_m. A scan s of a witness d adds to K_m what s shares with
simplices that m - 1 others have seen. That is exact and independent of the order of the scans.
Scans inside the highest level are forgotten: whoever sees them, nothing changes.
"""

from collections.abc import Iterable, Sequence
from itertools import product
from typing import Self

import numpy as np

from homsense.engine import Engine
from homsense.errors import InvalidConfigurationError
from homsense.euler import maximal
from homsense.homology import bits
from homsense.scan import observation
from homsense.simplicial import LandmarkComplex, Simplex

_LANDMARK, _WITNESS = "l", "w"


class WitnessFiltration:
    """Landmark complexes K_1, K_2... by the number of distinct witnesses of each simplex.

    A value: versions are never changed by what is observed later.

    Parameters
    ----------
    depth : int, default 1
        How many levels are kept, at least 1; work grows with it.
    engine : Engine, optional
        What runs the hot loops; the fastest by default.

    Raises
    ------
    InvalidConfigurationError
        If the depth is not positive.

    Examples
    --------
    >>> crowd = WitnessFiltration(depth=2).with_observations(
    ...     [("ann", {"a", "b", "c"}), ("bob", {"b", "c", "d"}), ("bob", {"a", "d"})]
    ... )
    >>> [sorted(map(sorted, crowd.level(m).facets)) for m in (1, 2)]
    [[['a', 'b', 'c'], ['a', 'd'], ['b', 'c', 'd']], [['a'], ['b', 'c']]]
    """

    __slots__ = ("_levels", "_pending")

    def __init__(self, depth: int = 1, engine: Engine | None = None) -> None:
        if depth < 1:
            message = f"depth must be at least 1, not {depth}"
            raise InvalidConfigurationError(message, "depth")
        self._levels = tuple(LandmarkComplex(engine) for _ in range(depth))
        self._pending = LandmarkComplex(engine)

    @property
    def depth(self) -> int:
        """How many levels are kept."""
        return len(self._levels)

    def level(self, witnesses: int) -> LandmarkComplex:
        """Return the complex of what enough witnesses have seen.

        Parameters
        ----------
        witnesses : int
            How many there must be, 1 to `depth`.

        Returns
        -------
        LandmarkComplex
            K_m.

        Raises
        ------
        InvalidConfigurationError
            If that level is not kept.
        """
        if not 1 <= witnesses <= self.depth:
            message = f"witnesses must lie between 1 and {self.depth}, not {witnesses}"
            raise InvalidConfigurationError(message, "witnesses")
        return self._levels[witnesses - 1]

    def with_observations(self, observations: Iterable[tuple[str, Iterable[str]]]) -> Self:
        """Return the filtration with more observations.

        Parameters
        ----------
        observations : iterable of (str, iterable of str)
            Who saw, and which landmarks.

        Returns
        -------
        WitnessFiltration
            A new version; this one stays valid.
        """
        seen = [(witness, observation(landmarks)) for witness, landmarks in observations]
        levels, pending = list(self._levels), self._pending
        top = levels[-1]
        if self.depth > 1:
            for witness, scan in seen:
                row = _row(witness, scan)
                if not scan or scan in top or row in pending:
                    continue
                for index, shared in enumerate(_shared(pending, witness, scan, self.depth - 1)):
                    levels[index + 1] = levels[index + 1].with_observations(shared)
                pending, top = pending.with_observation(row), levels[-1]
        levels[0] = levels[0].with_observations(scan for _, scan in seen)
        return self.of_parts([*levels, pending])

    def __or__(self, other: "WitnessFiltration") -> Self:
        """Return the filtration of the observations of both; depths must be equal."""
        if other.depth != self.depth:
            return NotImplemented
        levels = [mine | theirs for mine, theirs in zip(self._levels, other._levels, strict=True)]
        rows = map(_witness_and_scan, other._pending.facets)
        return self.of_parts([*levels, self._pending]).with_observations(rows)

    def digest(self) -> tuple[str, ...]:
        """Return the canonical hashes of the levels.

        Returns
        -------
        tuple of str
            One for each level.
        """
        return tuple(level.digest() for level in self._levels)

    def run_by(self, engine: Engine) -> Self:
        """Return the same filtration, run by another engine.

        Parameters
        ----------
        engine : Engine
            What runs the hot loops from now on.

        Returns
        -------
        WitnessFiltration
            Equal to this one.
        """
        return self.of_parts([part.run_by(engine) for part in self.parts])

    @property
    def parts(self) -> tuple[LandmarkComplex, ...]:
        """The levels, and behind them what was seen by witness, as `of_parts` takes them."""
        return (*self._levels, self._pending)

    @classmethod
    def of_parts(cls, parts: Sequence[LandmarkComplex]) -> Self:
        """Return the filtration that has some parts.

        Parameters
        ----------
        parts : sequence of LandmarkComplex
            From `parts`.

        Returns
        -------
        WitnessFiltration
            Equal to the one they are from.
        """
        same = cls.__new__(cls)
        same._levels, same._pending = tuple(parts[:-1]), parts[-1]
        return same


def _row(witness: str, scan: Simplex) -> Simplex:
    """Return a scan with its witness as one more vertex, so that facets are kept by witness."""
    return frozenset([_WITNESS + witness, *(_LANDMARK + landmark for landmark in scan)])


def _witness_and_scan(row: Iterable[str]) -> tuple[str, Simplex]:
    witness = next(name for name in row if name.startswith(_WITNESS))
    return witness[1:], frozenset(name[1:] for name in row if name != witness)


def _shared(
    pending: LandmarkComplex, witness: str, scan: Simplex, most: int
) -> list[list[Simplex]]:
    """Return what a scan shares with simplices that 1, 2... up to `most` others have seen."""
    landmarks = sorted(scan)
    by_witness = _masks_by_witness(pending, witness, landmarks)
    levels: list[list[int]] = [[] for _ in range(most)]
    for masks in by_witness.values():
        for index in range(most - 1, 0, -1):
            mixed = (a & b for a, b in product(masks, levels[index - 1]))
            levels[index] = maximal([*levels[index], *mixed])
        levels[0] = maximal([*levels[0], *masks])
    return [
        [frozenset(landmarks[place] for place in bits(mask)) for mask in level] for level in levels
    ]


def _masks_by_witness(
    pending: LandmarkComplex, witness: str, landmarks: list[str]
) -> dict[str, list[int]]:
    """Return which of some landmarks each row of another witness holds, as bit masks."""
    version = pending.version
    own = np.zeros(version.n_facets, np.bool_)
    own[version.posting_lists(pending.numbers([_WITNESS + witness])).values] = True
    masks: dict[int, int] = {}
    for place, landmark in enumerate(landmarks):
        through = version.posting_lists(pending.numbers([_LANDMARK + landmark])).values
        for row in through[~own[through]].tolist():
            masks[row] = masks.get(row, 0) | 1 << place
    found: dict[str, set[int]] = {}
    rows = version.rows(np.array(list(masks), np.int32))
    for mask, row in zip(masks.values(), rows.lists(), strict=True):
        other, _ = _witness_and_scan(pending.names(np.array(row, np.int32)))
        found.setdefault(other, set()).add(mask)
    return {other: maximal(of_one) for other, of_one in found.items()}
