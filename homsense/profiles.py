"""What each landmark has around it, and what a scan makes of that.

The hole count of a visible set's neighborhood (Algorithm 3) changes whenever a landmark comes into
view or is missed. The mean over the landmarks in view, of the holes near each one alone, changes
little; and what is near a landmark is counted once for all scans that see it.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from homsense.sensing import LocalHomology, sense_local_homology
from homsense.simplicial import LandmarkComplex


class Profiles:
    """Holes near each landmark of a complex, counted when they are first asked for.

    Parameters
    ----------
    grown : LandmarkComplex
        What all observations have built.
    hops : sequence of int
        Radii of the neighborhoods, rising.
    without : frozenset of str, optional
        Landmarks that are left out of the complex.

    Examples
    --------
    >>> ring = [{"a", "b"}, {"b", "c"}, {"c", "d"}, {"d", "e"}, {"e", "f"}, {"f", "a"}]
    >>> profiles = Profiles(LandmarkComplex.from_observations(ring), [1, 3])
    >>> profiles.mean_holes({"a", "b"})
    (0.0, 1.0)
    """

    def __init__(
        self,
        grown: LandmarkComplex,
        hops: Sequence[int],
        without: frozenset[str] = frozenset(),
    ) -> None:
        self.hops = tuple(hops)
        self._grown = grown
        self._without = without
        self._found: dict[str, list[LocalHomology]] = {}

    def onward(self, grown: LandmarkComplex, without: frozenset[str] = frozenset()) -> "Profiles":
        """Return the profiles of a later complex; counts that still hold are not made again.

        Parameters
        ----------
        grown : LandmarkComplex
            A version that grew from the one before.
        without : frozenset of str, optional
            Landmarks that are left out of the complex.

        Returns
        -------
        Profiles
            Of the later complex; they remember together with these.
        """
        later = Profiles(grown, self.hops, without)
        if without == self._without:
            later._found = self._found
        return later

    def holes(self, landmark: str) -> tuple[int, ...]:
        """Return the holes near one landmark.

        Parameters
        ----------
        landmark : str
            Of the complex.

        Returns
        -------
        tuple of int
            One count for each radius.
        """
        found = self._found.get(landmark)
        if found is None or not found[-1].holds_in(self._grown):
            found = sense_local_homology(self._grown, [landmark], self.hops, without=self._without)
            self._found[landmark] = found
        return tuple(level.holes for level in found)

    def mean_holes(self, visible: Iterable[str]) -> tuple[float, ...] | None:
        """Return what a scan measures: the mean over the landmarks in view.

        Parameters
        ----------
        visible : iterable of str
            Landmarks in view; those that the complex does not know are ignored.

        Returns
        -------
        tuple of float, optional
            One number for each radius; None when the complex knows none of them.
        """
        known = sorted(self._grown.names(self._grown.numbers(visible)) - self._without)
        if not known:
            return None
        holes = np.array([self.holes(landmark) for landmark in known])
        return tuple(holes.mean(axis=0).tolist())

    def sampled(self, most: int = 500) -> NDArray[np.float64]:
        """Return the holes near each landmark, or near some when there are many.

        Parameters
        ----------
        most : int, default 500
            How many at most.

        Returns
        -------
        ndarray, shape (T, n_levels), float64
            The same landmarks each time.
        """
        known = sorted(self._grown.landmarks - self._without)
        return self.table(known[:: max(1, -(-len(known) // most))])

    def table(self, landmarks: Sequence[str]) -> NDArray[np.float64]:
        """Return the holes near each of some landmarks.

        Parameters
        ----------
        landmarks : sequence of str
            Any.

        Returns
        -------
        ndarray, shape (len(landmarks), n_levels), float64
            Not a number for those that the complex does not know.
        """
        known = self._grown.landmarks - self._without
        nothing = (np.nan,) * len(self.hops)
        rows = [self.holes(name) if name in known else nothing for name in landmarks]
        return np.array(rows, np.float64).reshape(-1, len(self.hops))
