"""The visibility relation R of observations x landmarks (A4, A5)."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self

from homsense.scan import observation


@dataclass(frozen=True, slots=True)
class VisibilityRelation:
    """Which observation sees which landmark; an append-only value.

    Parameters
    ----------
    rows : tuple of frozenset of str
        One set of landmarks for each observation, in the order of arrival.
    """

    rows: tuple[frozenset[str], ...] = ()

    @classmethod
    def from_observations(cls, observations: Iterable[Iterable[str]]) -> Self:
        """Return the relation with one row for each observation.

        Parameters
        ----------
        observations : iterable of iterable of str
            The landmarks in view at each observation.

        Returns
        -------
        VisibilityRelation
            The relation.
        """
        return cls(tuple(observation(landmarks) for landmarks in observations))

    def with_observation(self, landmarks: Iterable[str]) -> Self:
        """Return the relation with one more row.

        Parameters
        ----------
        landmarks : iterable of str
            The landmarks in view.

        Returns
        -------
        VisibilityRelation
            The longer relation; this one stays as it is.
        """
        return type(self)((*self.rows, observation(landmarks)))

    def transposed(self) -> Self:
        """Return the relation of landmarks x observations.

        Observations are named by their row number, rows follow the sorted landmarks.

        Returns
        -------
        VisibilityRelation
            One row for each landmark: the observations that see it.

        Examples
        --------
        >>> relation = VisibilityRelation.from_observations([{"a"}, {"a", "b"}])
        >>> [sorted(row) for row in relation.transposed().rows]
        [['0', '1'], ['1']]
        """
        columns: dict[str, set[str]] = {}
        for number, row in enumerate(self.rows):
            for landmark in row:
                columns.setdefault(landmark, set()).add(str(number))
        return type(self)(tuple(frozenset(columns[landmark]) for landmark in sorted(columns)))
