"""The homological sensor: Algorithm 3, senseLocalHomology."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from homsense import neighborhood
from homsense.errors import InvalidComplexError
from homsense.facet_table import Numbers
from homsense.neighborhood import Neighborhoods
from homsense.scan import observation
from homsense.simplicial import LandmarkComplex


@dataclass(frozen=True)
class LocalHomology:
    """The homology of the full subcomplex on one neighborhood.

    Parameters
    ----------
    landmark_complex : LandmarkComplex
        The complex that was asked.
    hops : int, optional
        Radius of the neighborhood, when it was asked for in hops.
    r_pseudo_m : float, optional
        Radius, metres, when it was asked for in metres.
    numbers : ndarray, int32
        Numbers of its landmarks in the complex.
    reach : ndarray, int32
        Numbers of all landmarks that decide the answer.
    betti : tuple of int
        (b0, b1) of the subcomplex over GF(2).
    lasting : int, optional
        Holes that are still there one hop farther; the others are phantoms that appeared when the
        neighborhood was cut out. ``None`` when that was not asked.
    """

    landmark_complex: LandmarkComplex
    hops: int | None
    r_pseudo_m: float | None
    numbers: Numbers
    reach: Numbers
    betti: tuple[int, int]
    lasting: int | None = None

    def holds_in(self, later: LandmarkComplex) -> bool:
        """Tell whether a later version gives the same answer, without counting again.

        Parameters
        ----------
        later : LandmarkComplex
            A version that grew from the one that was asked.

        Returns
        -------
        bool
            True when no facet through the landmarks that decide has come since; False also when
            that cannot be told cheaply. Landmarks in view that were not known then and are now
            are not seen by this test.
        """
        return later.agrees_on(self.landmark_complex, self.reach)

    @property
    def holes(self) -> int:
        """The measurement: b1, the number of holes in the neighborhood."""
        return self.betti[1]

    @property
    def n_landmarks(self) -> int:
        """How many landmarks the ball holds."""
        return len(self.numbers)

    @cached_property
    def landmarks(self) -> frozenset[str]:
        """The ball."""
        return self.landmark_complex.names(self.numbers)

    @cached_property
    def subcomplex(self) -> LandmarkComplex:
        """The full subcomplex on the ball."""
        return self.landmark_complex.induced(self.landmarks)

    @property
    def n_facets(self) -> int:
        """How many facets the subcomplex has."""
        return self.subcomplex.n_facets

    @cached_property
    def euler(self) -> int:
        """The Euler characteristic; 1 - euler is b1 only under Lemma 5.1 of the paper."""
        return self.subcomplex.euler_characteristic()


def sense_local_homology(
    landmark_complex: LandmarkComplex,
    visible: Iterable[str],
    hops: Iterable[int] = (2, 3),
    *,
    lasting: bool = False,
    without: Collection[str] = (),
) -> list[LocalHomology]:
    """Count the holes of the landmark complex near a visible set (Algorithm 3).

    Parameters
    ----------
    landmark_complex : LandmarkComplex
        What all observations have built.
    visible : iterable of str
        The landmarks in view now; those the complex does not know are ignored.
    hops : iterable of int, default (2, 3)
        Radii of the neighborhoods, near and far in the paper; any order, not negative.
    lasting : bool, default False
        Whether to look one hop farther and tell how many holes live on there.
    without : collection of str
        Landmarks that are left out of the complex, such as those in quarantine.

    Returns
    -------
    list of LocalHomology
        One for each radius, in the order given; all from one pass over the widest ball.

    Raises
    ------
    InvalidComplexError
        If a radius is negative.

    Examples
    --------
    >>> k = LandmarkComplex.from_observations([{"a", "b"}, {"b", "c"}, {"a", "c"}])
    >>> [(level.hops, level.holes) for level in sense_local_homology(k, {"a"}, hops=[0, 1])]
    [(0, 0), (1, 1)]
    """
    wanted = list(hops)
    rising = sorted({*wanted, *(radius + 1 for radius in wanted if lasting)})
    found = landmark_complex.sense(visible, rising, without)
    return [
        _level(
            landmark_complex,
            found,
            rising.index(radius),
            hops=radius,
            farther=rising.index(radius + 1) if lasting else None,
        )
        for radius in wanted
    ]


def sense_within(
    landmark_complex: LandmarkComplex,
    visible: Iterable[str],
    r_pseudo_m: Iterable[float],
    s_max_m: float | Mapping[str, float],
    *,
    without: Collection[str] = (),
) -> list[LocalHomology]:
    """Count the holes within some pseudo-distances of a visible set (Algorithm 3, r_pseudo).

    Parameters
    ----------
    landmark_complex : LandmarkComplex
        What all observations have built.
    visible : iterable of str
        The landmarks in view now; those the complex does not know are ignored.
    r_pseudo_m : iterable of float
        Radii of the neighborhoods, metres; any order, not negative.
    s_max_m : float or mapping of str to float
        The length of every edge of the 1-skeleton, metres; or the range of each landmark, and an
        edge is as long as the mean of its two.
    without : collection of str
        Landmarks that are left out of the complex.

    Returns
    -------
    list of LocalHomology
        One for each radius, in the order given.

    Raises
    ------
    InvalidComplexError
        If a radius is negative, or a range is not positive or missing.

    Examples
    --------
    >>> k = LandmarkComplex.from_observations([{"a", "b"}, {"b", "c"}, {"c", "d"}, {"a", "d"}])
    >>> [level.holes for level in sense_within(k, {"a"}, [90.0, 160.0], s_max_m=80.0)]
    [0, 1]
    """
    wanted = list(r_pseudo_m)
    rising = neighborhood.rising(sorted(wanted))
    ranges = _ranges(landmark_complex, s_max_m)
    seeds = landmark_complex.numbers(observation(visible))
    left_out = landmark_complex.numbers(without)
    order, ends = neighborhood.metric_order(
        landmark_complex.version, seeds, rising, ranges, left_out
    )
    homology = landmark_complex.homology_along(order, ends)
    found = Neighborhoods(order, ends, homology)
    return [
        _level(landmark_complex, found, rising.index(radius), r_pseudo_m=radius)
        for radius in wanted
    ]


def _level(
    landmark_complex: LandmarkComplex,
    found: Neighborhoods,
    at: int,
    *,
    hops: int | None = None,
    r_pseudo_m: float | None = None,
    farther: int | None = None,
) -> LocalHomology:
    order, ends, homology = found
    return LocalHomology(
        landmark_complex,
        hops,
        r_pseudo_m,
        order[: ends[at]],
        order[: ends[at if farther is None else farther]],
        homology.betti(at),
        None if farther is None else homology.rank(at, farther),
    )


def _ranges(
    landmark_complex: LandmarkComplex, s_max_m: float | Mapping[str, float]
) -> NDArray[np.float64]:
    """Return the range of each landmark by number."""
    count = landmark_complex.n_landmarks
    if isinstance(s_max_m, Mapping):
        ranges = np.zeros(count)
        for name, range_m in s_max_m.items():
            ranges[landmark_complex.numbers([name])] = range_m
    else:
        ranges = np.full(count, float(s_max_m))
    if not np.all(ranges > 0.0):
        message = "s_max_m must be positive for every landmark"
        raise InvalidComplexError(message, "s_max_m")
    return ranges
