"""Which holes are meant: a short closed walk round each of them.

The potentials of `homsense.homology` tell how a closed walk winds round the live classes: the sum
of the potentials over its incidences, a vector over GF(2). Walks with independent vectors stand
for independent holes. A walk that winds at all passes through a simplex with a potential that is
not constant, so a breadth-first search from each of those finds the shortest candidates.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from homsense.homology import MayerVietoris, bits

Incidences = list[tuple[int, int]]
"""(point of a simplex, or simplex through a point; the potentials there) pairs."""


@dataclass(frozen=True, slots=True)
class ClosedWalk:
    """A closed walk over simplices, each sharing a point with the next.

    Parameters
    ----------
    simplices : tuple of int
        Their positions in the input, cyclic.
    winding : int
        Bit mask of the classes that it winds round.
    """

    simplices: tuple[int, ...]
    winding: int


def round_holes(facets: Iterable[Iterable[str]]) -> list[tuple[str, ...]]:
    """Return a short closed walk round each hole of a complex.

    Parameters
    ----------
    facets : iterable of iterable of str
        Its facets, in any order.

    Returns
    -------
    list of tuple of str
        Vertices, as many walks as b1, shortest first; the same for equal complexes.

    Examples
    --------
    >>> round_holes([{"a", "b"}, {"b", "c"}, {"c", "a"}])
    [('c', 'b', 'a')]
    """
    through: dict[str, int] = {}
    for number, facet in enumerate(sorted(map(sorted, facets))):
        for vertex in facet:
            through[vertex] = through.get(vertex, 0) | 1 << number
    vertices = list(through)
    walks = shortest_cycles(list(through.values()))
    return [tuple(vertices[index] for index in walk.simplices) for walk in walks]


def shortest_cycles(simplices: Sequence[int]) -> list[ClosedWalk]:
    """Return short closed walks that stand for a basis of H_1.

    Parameters
    ----------
    simplices : sequence of int
        Bit masks, none empty.

    Returns
    -------
    list of ClosedWalk
        As many as b1, shortest first.

    Examples
    --------
    >>> [walk.simplices for walk in shortest_cycles([0b011, 0b110, 0b101])]
    [(2, 1, 0)]
    """
    engine = MayerVietoris()
    numbers = [
        number for number, simplex in enumerate(simplices) if engine.add(simplex, bits(simplex))
    ]
    points = [
        [(point, engine.label(index, point)) for point in bits(simplices[number])]
        for index, number in enumerate(numbers)
    ]
    through: dict[int, Incidences] = {}
    for index, incidences in enumerate(points):
        for point, label in incidences:
            through.setdefault(point, []).append((index, label))
    candidates = sorted(
        (
            walk
            for start in range(len(numbers))
            if engine.is_labelled(start)
            for walk in _walks_from(start, points, through)
        ),
        key=lambda walk: (len(walk.simplices), walk.simplices),
    )
    return [
        ClosedWalk(tuple(numbers[index] for index in walk.simplices), walk.winding)
        for walk in _independent(candidates, engine.betti[1])
    ]


def _walks_from(
    start: int, points: Sequence[Incidences], through: dict[int, Incidences]
) -> Iterator[ClosedWalk]:
    """Yield the first closed walk of each winding that a breadth-first search meets.

    The search goes from simplices to their points and on; each incidence outside its tree closes
    a walk.
    """
    path: dict[int, tuple[int, ...]] = {start: (start,)}
    winding: dict[int, int] = {start: 0}
    reached: dict[int, tuple[int, int]] = {}
    met: set[int] = {0}
    queue = deque([start])
    while queue:
        here = queue.popleft()
        for point, label in points[here]:
            wound = winding[here] ^ label
            if point not in reached:
                reached[point] = here, wound
                for there, other in through[point]:
                    if there not in path:
                        path[there] = (*path[here], there)
                        winding[there] = wound ^ other
                        queue.append(there)
                continue
            before, as_before = reached[point]
            if wound ^ as_before not in met:
                met.add(wound ^ as_before)
                yield ClosedWalk(_closed(path[here], path[before]), wound ^ as_before)


def _closed(one: tuple[int, ...], other: tuple[int, ...]) -> tuple[int, ...]:
    """Join two paths from the same start at their ends, without what they share before."""
    shared = 0
    while shared < min(len(one), len(other)) and one[shared] == other[shared]:
        shared += 1
    return (*one[shared - 1 :], *reversed(other[shared:]))


def _independent(candidates: list[ClosedWalk], wanted: int) -> list[ClosedWalk]:
    """Keep the first walks whose windings are independent."""
    pivots: dict[int, int] = {}
    kept: list[ClosedWalk] = []
    for walk in candidates:
        if len(kept) == wanted:
            break
        rest = walk.winding
        while rest and rest.bit_length() in pivots:
            rest ^= pivots[rest.bit_length()]
        if rest:
            pivots[rest.bit_length()] = rest
            kept.append(walk)
    return kept
