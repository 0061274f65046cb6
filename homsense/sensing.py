"""The homological sensor: Algorithm 3, senseLocalHomology."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

from homsense.facet_table import Numbers
from homsense.simplicial import LandmarkComplex


@dataclass(frozen=True)
class LocalHomology:
    """The homology of the full subcomplex on one hop ball.

    Parameters
    ----------
    landmark_complex : LandmarkComplex
        The complex that was asked.
    hops : int
        Radius of the ball.
    numbers : ndarray, int32
        The ball: numbers of its landmarks in the complex.
    betti : tuple of int
        (b0, b1) of the subcomplex over GF(2).
    lasting : int, optional
        Holes that are still there one hop farther; the others are phantoms that appeared when the
        neighborhood was cut out. ``None`` when that was not asked.
    """

    landmark_complex: LandmarkComplex
    hops: int
    numbers: Numbers
    betti: tuple[int, int]
    lasting: int | None = None

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
    farther = {radius + 1 for radius in wanted} if lasting else set[int]()
    rising = sorted(farther.union(wanted))
    order, ends, homology = landmark_complex.sense(visible, rising)
    levels = {
        radius: LocalHomology(
            landmark_complex,
            radius,
            order[: ends[at]],
            homology.betti(at),
            homology.rank(at, rising.index(radius + 1)) if lasting else None,
        )
        for at, radius in enumerate(rising)
        if radius in wanted
    }
    return [levels[radius] for radius in wanted]
