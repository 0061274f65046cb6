"""The homology of complexes of which each lies in the next."""

from collections.abc import Sequence

from homsense.engine import Engine, fastest
from homsense.facet_table import Ragged
from homsense.history import History
from homsense.simplicial import LandmarkComplex


def nested_homology(complexes: Sequence[LandmarkComplex], engine: Engine | None = None) -> History:
    """Return the homology of growing complexes, with the barcode between them.

    Parameters
    ----------
    complexes : sequence of LandmarkComplex
        Each inside the next.
    engine : Engine, optional
        What counts; the fastest by default.

    Returns
    -------
    History
        One place for each complex.

    Examples
    --------
    >>> ring = LandmarkComplex.from_observations([{"a", "b"}, {"b", "c"}, {"a", "c"}])
    >>> found = nested_homology([ring, ring.with_observation({"a", "b", "c"})])
    >>> found.betti(0), found.betti(1), found.rank(0, 1)
    ((1, 1), (1, 0), 0)
    """
    number: dict[str, int] = {}
    rows: list[list[int]] = []
    ends: list[int] = []
    for grown in complexes:
        facets = sorted(map(sorted, grown.facets))
        rows += [[number.setdefault(name, len(number)) for name in facet] for facet in facets]
        ends.append(len(rows))
    return (engine or fastest()).history(Ragged.of(rows), ends)
