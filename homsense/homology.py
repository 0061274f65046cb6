"""Homology over GF(2) of a complex given by generating simplices; no face is ever listed.

A simplex is an integer whose set bits are its vertices ("points" here: in the Dowker dual the
points are facets and the simplices are posting lists of landmarks). This file knows neither.

The state after each simplex F is a basis of H^1, written as potentials: for each generator and
each simplex a subset of its points (a "plane"), such that on the overlap of two simplices their
planes differ by a constant. Adding F glues it along L = F n K (Mayer-Vietoris):

- a piece of L in a component that F already touches closes a new cycle: one generator is born;
- a class lives on if it is trivial on L; each independent failure is a relation that kills the
  youngest generator in it (the elder rule).
"""

from collections.abc import Iterable, Iterator

Planes = dict[int, int]
"""Generator -> points of one simplex where its potential is 1; constant planes are left out."""

_RECENT = 8


def bits(mask: int) -> Iterator[int]:
    """Yield the positions of the set bits, lowest first.

    Parameters
    ----------
    mask : int
        A non-negative integer.

    Yields
    ------
    int
        A position.

    Examples
    --------
    >>> list(bits(0b1011))
    [0, 1, 3]
    """
    while mask:
        low = mask & -mask
        yield low.bit_length() - 1
        mask ^= low


class MayerVietoris:
    """Betti numbers b0 and b1 of a growing complex.

    Examples
    --------
    >>> hollow_triangle = MayerVietoris()
    >>> edges_and_a_point = [0, 1], [1, 2], [0, 2], [2]
    >>> [hollow_triangle.add(sum(1 << p for p in face), face) for face in edges_and_a_point]
    [True, True, True, False]
    >>> hollow_triangle.betti
    (1, 1)
    """

    def __init__(self) -> None:
        self._simplices: list[int] = []
        self._planes: list[Planes] = []
        self._through: list[int] = []
        self._carriers: dict[int, int] = {}
        self._labelled = 0
        self._seen = 0
        self._parent: list[int] = []
        self._components = 0
        self._birth: list[int] = []

    def is_labelled(self, index: int) -> bool:
        """Tell whether any potential varies over a simplex.

        Parameters
        ----------
        index : int
            Number of the simplex, in the order of addition.

        Returns
        -------
        bool
            False when a walk through it winds round nothing there.
        """
        return bool(self._planes[index])

    def label(self, index: int, point: int) -> int:
        """Return the potentials of all classes at a point of a simplex.

        Parameters
        ----------
        index : int
            Number of the simplex, in the order of addition.
        point : int
            One of its points.

        Returns
        -------
        int
            Bit mask over classes.
        """
        planes = self._planes[index]
        return sum(1 << generator for generator, plane in planes.items() if plane >> point & 1)

    @property
    def size(self) -> int:
        """The number of simplices that have got a number."""
        return len(self._simplices)

    @property
    def births(self) -> list[int]:
        """The number of simplices that were there when each live class was born, eldest first."""
        return [self._birth[generator] for generator in sorted(self._carriers)]

    @property
    def betti(self) -> tuple[int, int]:
        """The number of components and of independent cycles that bound nothing."""
        return self._components, len(self._carriers)

    def add(self, simplex: int, points: Iterable[int]) -> bool:
        """Add a simplex with all its faces; the empty simplex and repetitions change nothing.

        Parameters
        ----------
        simplex : int
            Bit mask of its points.
        points : iterable of int
            The same as numbers.

        Returns
        -------
        bool
            Whether it has got a number: one that is empty, or a face of one of the last, has not.
        """
        if not simplex:
            return False
        index, first = len(self._simplices), 0
        if shared := simplex & self._seen:
            first = self._best_overlap(shared)
            if not simplex & ~self._simplices[first]:
                return False
        self._parent.append(index)
        self._components += 1
        planes = self._glue(index, simplex, shared, first) if shared else {}
        self._append(simplex, points, planes, shared)
        return True

    def _append(self, simplex: int, points: Iterable[int], planes: Planes, shared: int) -> None:
        own = 1 << len(self._simplices)
        kept = {
            generator: plane | (simplex & ~shared) if _is_most(plane, shared) else plane
            for generator, plane in planes.items()
            if plane not in (0, shared)
        }
        for generator in planes:
            self._carriers.setdefault(generator, 0)
            if generator in kept:
                self._carriers[generator] |= own
        if kept:
            self._labelled |= own
        self._simplices.append(simplex)
        self._planes.append(kept)
        self._seen |= simplex
        self._through.extend([0] * (simplex.bit_length() - len(self._through)))
        for point in points:
            self._through[point] |= own

    def _glue(self, index: int, simplex: int, shared: int, first: int) -> Planes:
        """Return the planes of a new simplex; kill the classes that are not trivial on L."""
        planes: Planes = {}
        pieces: list[tuple[int, int]] = []
        uncovered = shared
        start = first
        while True:
            piece = self._grow_piece(simplex, start, uncovered, planes)
            pieces.append((piece, self._root(start)))
            uncovered &= ~piece
            if not uncovered:
                break
            lowest = (uncovered & -uncovered).bit_length() - 1
            start = next(bits(self._through[lowest]))
        if outside := shared & ~self._simplices[first]:
            self._check(simplex, outside, planes)
        self._join(index, pieces, planes)
        return planes

    def _best_overlap(self, shared: int) -> int:
        """Return a simplex that covers much of the shared points, the latest of several."""
        best, most, total = 0, 0, shared.bit_count()
        last = len(self._simplices) - 1
        for index in range(last, max(-1, last - _RECENT), -1):
            overlap = (self._simplices[index] & shared).bit_count()
            if overlap > most:
                best, most = index, overlap
                if most == total:
                    break
        return best if most else next(bits(self._through[(shared & -shared).bit_length() - 1]))

    def _grow_piece(self, simplex: int, start: int, uncovered: int, planes: Planes) -> int:
        """Grow the piece of L that holds a simplex's overlap, and carry the labels over it."""
        piece = self._simplices[start] & simplex
        for generator, plane in self._planes[start].items():
            planes[generator] = planes.get(generator, 0) | (plane & piece)
        uncovered &= ~piece
        growing = True
        while growing and uncovered:
            growing = False
            for point in bits(uncovered):
                if not uncovered >> point & 1:
                    continue
                for neighbor in _latest_first(self._through[point]):
                    meeting = self._simplices[neighbor] & piece
                    if not meeting:
                        continue
                    fresh = self._simplices[neighbor] & simplex & ~piece
                    if planes or self._planes[neighbor]:
                        self._carry(planes, self._planes[neighbor], meeting & -meeting, fresh)
                    piece |= fresh
                    uncovered &= ~fresh
                    growing = True
                    break
        return piece

    @staticmethod
    def _carry(planes: Planes, others: Planes, at: int, fresh: int) -> None:
        """Extend the planes to fresh points so that they agree with a neighbor's at one point."""
        for generator in planes.keys() | others.keys():
            other = others.get(generator, 0)
            own = planes.get(generator, 0)
            constant = fresh if (own ^ other) & at else 0
            planes[generator] = own | ((other & fresh) ^ constant)

    def _check(self, simplex: int, outside: int, planes: Planes) -> None:
        """Compare with every simplex that meets the new one outside its first overlap.

        Where two meet within what a third shared and agreed on, they agree: it did with both.
        """
        candidates = _union(self._through, outside)
        if not any(planes.values()):
            candidates &= self._labelled
        beyond = simplex
        for neighbor in _latest_first(candidates):
            meeting = self._simplices[neighbor] & simplex
            if not meeting & beyond:
                continue
            others = self._planes[neighbor]
            while not _agree(planes, others, meeting):
                relation = _difference(planes, others, meeting)
                self._kill(max(relation), relation, planes)
            beyond = simplex & ~meeting

    def _kill(self, youngest: int, relation: set[int], current: Planes) -> None:
        """Remove a generator and substitute it wherever it labels a simplex."""
        others = relation - {youngest}
        for index in bits(self._carriers.pop(youngest)):
            simplex, planes = self._simplices[index], self._planes[index]
            plane = planes.pop(youngest)
            own = 1 << index
            for generator in others:
                mixed = planes.get(generator, 0) ^ plane
                if mixed in (0, simplex):
                    planes.pop(generator, None)
                    self._carriers[generator] &= ~own
                else:
                    planes[generator] = mixed
                    self._carriers[generator] |= own
            if not planes:
                self._labelled &= ~own
        plane = current.pop(youngest, 0)
        for generator in others:
            current[generator] = current.get(generator, 0) ^ plane

    def _join(self, index: int, pieces: list[tuple[int, int]], planes: Planes) -> None:
        """Unite components; a second piece of the same component bears a generator."""
        touched: set[int] = set()
        for piece, root in pieces:
            if root in touched:
                planes[len(self._birth)] = piece
                self._birth.append(index)
            else:
                touched.add(root)
                self._parent[root] = index
                self._components -= 1

    def _root(self, index: int) -> int:
        while self._parent[index] != index:
            self._parent[index] = self._parent[self._parent[index]]
            index = self._parent[index]
        return index


def _latest_first(mask: int) -> Iterator[int]:
    """Yield the positions of the set bits, highest first: late simplices are near."""
    while mask:
        position = mask.bit_length() - 1
        yield position
        mask ^= 1 << position


def _union(masks: list[int], members: int) -> int:
    """Return the union of those masks whose positions are set."""
    found = 0
    while members:
        low = members & -members
        found |= masks[low.bit_length() - 1]
        members ^= low
    return found


def _is_most(plane: int, shared: int) -> bool:
    """Tell whether new points get potential 1: as most old ones, so that fewer planes vary."""
    return 2 * plane.bit_count() > shared.bit_count()


def _agree(one: Planes, other: Planes, meeting: int) -> bool:
    """Tell whether the planes of two simplices differ by constants where they meet."""
    for generator, plane in one.items():
        apart = (plane ^ other.get(generator, 0)) & meeting
        if apart and apart != meeting:
            return False
    for generator, plane in other.items():
        apart = plane & meeting
        if apart and apart != meeting and generator not in one:
            return False
    return True


def _difference(one: Planes, other: Planes, meeting: int) -> set[int]:
    """Return the generators whose planes differ by more than a constant between two points."""
    origin = meeting & -meeting
    varying: dict[int, int] = {}
    for generator in one.keys() | other.keys():
        apart = (one.get(generator, 0) ^ other.get(generator, 0)) & meeting
        if apart & origin:
            apart ^= meeting
        if apart:
            varying[generator] = apart
    witness = next(iter(varying.values()))
    witness &= -witness
    return {generator for generator, apart in varying.items() if apart & witness}
