"""The witness check: what the complex would be if more distinct devices had to agree.

Half a percent of bad scans is enough to ruin the raw count. Holes that are structures stay when
more witnesses are asked for, and are still there when fewer are; accidents are not.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from statistics import median

from homsense.engine import Engine
from homsense.nested import nested_homology
from homsense.scan import observation
from homsense.witness import WitnessFiltration

BAD_SHARE = 0.005


@dataclass(frozen=True, slots=True)
class WitnessPoint:
    """The complex of what some number of distinct witnesses has seen.

    Parameters
    ----------
    witnesses : int
        How many there must be.
    landmarks, facets : int
        Size of the complex.
    betti : tuple of int
        (b0, b1).
    lasting : int
        Holes that are still there with one witness fewer; b1 itself for one witness.
    """

    witnesses: int
    landmarks: int
    facets: int
    betti: tuple[int, int]
    lasting: int


def witness_curve(
    observations: Iterable[tuple[str, Iterable[str]]],
    depth: int = 4,
    engine: Engine | None = None,
) -> list[WitnessPoint]:
    """Return what the complex would be for 1, 2... distinct witnesses.

    Parameters
    ----------
    observations : iterable of (str, iterable of str)
        Who saw, and which landmarks.
    depth : int, default 4
        Most witnesses.
    engine : Engine, optional
        What runs the hot loops; the fastest by default.

    Returns
    -------
    list of WitnessPoint
        One for each number of witnesses.

    Examples
    --------
    >>> ring = [("ann", name) for name in ("ab", "bc", "cd", "da")]
    >>> crowd = [*ring, *(("bob", name) for _, name in ring), ("eve", "abcd")]
    >>> curve = witness_curve([(who, set(name)) for who, name in crowd], depth=2)
    >>> [(point.betti, point.lasting) for point in curve]
    [((1, 0), 0), ((1, 1), 0)]
    """
    filtration = WitnessFiltration(depth, engine).with_observations(observations)
    levels = [filtration.level(witnesses) for witnesses in range(depth, 0, -1)]
    found = nested_homology(levels, engine)
    return [
        WitnessPoint(
            depth - at,
            level.n_landmarks,
            level.n_facets,
            found.betti(at),
            found.rank(at, min(at + 1, depth - 1)),
        )
        for at, level in reversed(list(enumerate(levels)))
    ]


def median_witnesses(observations: Iterable[tuple[str, Iterable[str]]]) -> float:
    """Return by how many distinct witnesses a landmark has been seen, in the median.

    Parameters
    ----------
    observations : iterable of (str, iterable of str)
        Who saw, and which landmarks.

    Returns
    -------
    float
        0 when nothing was seen.
    """
    seen: dict[str, set[str]] = {}
    for witness, landmarks in observations:
        for landmark in observation(landmarks):
            seen.setdefault(landmark, set()).add(witness)
    return median(map(len, seen.values())) if seen else 0.0


def suggested_quorum(witnesses: float, bad_share: float = BAD_SHARE) -> int:
    """Return a quorum that grows with the density of the crowd.

    Where w devices have passed and a share of all scans is bad, about ``bad_share * w`` bad scans
    meet; a quorum of twice as many and one more keeps most of what they agree on out.

    Parameters
    ----------
    witnesses : float
        From `median_witnesses`.
    bad_share : float, default 0.005
        Expected share of bad scans, 0 to 1.

    Returns
    -------
    int
        At least 1.

    Examples
    --------
    >>> suggested_quorum(40), suggested_quorum(325)
    (1, 4)
    """
    return 1 + int(2 * bad_share * witnesses)
