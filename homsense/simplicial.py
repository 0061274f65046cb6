"""The landmark complex, kept as its facets; a value that only ever grows.

A *facet* is a maximal simplex. Two tables hold the whole complex: facet -> landmarks, and
landmark -> facets (posting lists), which is the Dowker dual. No face is ever listed.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple, Self

import networkx as nx

from homsense import chains, cycles, euler, homology
from homsense.errors import InvalidComplexError
from homsense.scan import observation

Simplex = frozenset[str]


class Tables(NamedTuple):
    """The facets both ways; never changed once a complex holds them."""

    simplices: Mapping[int, Simplex] = MappingProxyType({})
    postings: Mapping[str, frozenset[int]] = MappingProxyType({})
    next_number: int = 0


_EMPTY = Tables()


class LandmarkComplex:
    """A simplicial complex on landmarks: the simplices are the sets that were seen together.

    Equal complexes compare, hash and digest equal, however they were built.

    Examples
    --------
    >>> k = LandmarkComplex.from_observations([{"a", "b"}, {"b", "c"}, {"a", "c"}])
    >>> k.betti_numbers(), k.euler_characteristic()
    ((1, 1), 0)
    >>> k.with_observation({"a", "b", "c"}).betti_numbers()
    (1, 0)
    """

    __slots__ = ("_next", "_postings", "_simplices")

    def __init__(self, tables: Tables = _EMPTY) -> None:
        self._simplices = tables.simplices
        self._postings = tables.postings
        self._next = tables.next_number

    @classmethod
    def from_observations(cls, observations: Iterable[Iterable[str]]) -> Self:
        """Return the landmark complex of some observations (Algorithm 2, buildLandmarkComplex).

        Parameters
        ----------
        observations : iterable of iterable of str
            The landmarks in view at each observation; order and repetition do not matter.

        Returns
        -------
        LandmarkComplex
            The nerve.

        Raises
        ------
        InvalidScanError
            If an identifier is not a non-empty string.
        """
        return cls().with_observations(observations)

    def with_observation(self, landmarks: Iterable[str]) -> Self:
        """Return the complex with one more observation.

        Parameters
        ----------
        landmarks : iterable of str
            The landmarks in view; none changes nothing.

        Returns
        -------
        LandmarkComplex
            A new version; this one stays valid.
        """
        return self.with_observations([landmarks])

    def with_observations(self, observations: Iterable[Iterable[str]]) -> Self:
        """Return the complex with more observations.

        Parameters
        ----------
        observations : iterable of iterable of str
            The landmarks in view at each observation.

        Returns
        -------
        LandmarkComplex
            A new version, or this very one when every observation lies in a facet already.
        """
        simplices = dict(self._simplices)
        postings = dict(self._postings)
        number = self._next
        for landmarks in observations:
            simplex = observation(landmarks)
            if not simplex or _is_face(simplex, simplices, postings):
                continue
            for covered in _facets_inside(simplex, simplices, postings):
                for landmark in simplices.pop(covered):
                    postings[landmark] -= {covered}
            simplices[number] = simplex
            for landmark in simplex:
                postings[landmark] = postings.get(landmark, frozenset()) | {number}
            number += 1
        if number == self._next:
            return self
        return type(self)(Tables(simplices, postings, number))

    def __or__(self, other: "LandmarkComplex") -> Self:
        """Return the union: the complex of the observations of both."""
        if not isinstance(other, LandmarkComplex):
            return NotImplemented
        return self.with_observations(other._simplices.values())

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, LandmarkComplex):
            return NotImplemented
        return self.facets == other.facets

    def __hash__(self) -> int:
        return hash(self.facets)

    def __contains__(self, simplex: Iterable[str]) -> bool:
        """Tell whether a set of landmarks is a simplex; the empty set is none."""
        wanted = observation(simplex)
        return bool(wanted) and _is_face(wanted, self._simplices, self._postings)

    def __repr__(self) -> str:
        return f"<LandmarkComplex: {len(self._postings)} landmarks, {len(self._simplices)} facets>"

    @property
    def facets(self) -> frozenset[Simplex]:
        """The maximal simplices."""
        return frozenset(self._simplices.values())

    @property
    def landmarks(self) -> frozenset[str]:
        """The vertices: all landmarks that were ever observed."""
        return frozenset(self._postings)

    def digest(self) -> str:
        """Return a canonical hash: equal for equal complexes, in any process.

        Returns
        -------
        str
            SHA-256 of the facets in lexicographic order, hexadecimal.
        """
        ordered = sorted(sorted(simplex) for simplex in self._simplices.values())
        text = json.dumps(ordered, ensure_ascii=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()

    def betti_numbers(self, max_degree: int = 1) -> tuple[int, ...]:
        """Return the Betti numbers over GF(2) from degree 0 up.

        Degrees 0 and 1 come without any face being listed; higher ones list faces, below a limit.

        Parameters
        ----------
        max_degree : int, default 1
            Highest degree wanted, not negative.

        Returns
        -------
        tuple of int
            Components, holes, voids and so on; ``max_degree + 1`` numbers.

        Raises
        ------
        InvalidComplexError
            If the degree is negative.
        ComputationLimitError
            If a higher degree has too many faces to list.
        """
        if max_degree < 0:
            message = f"max_degree must not be negative, not {max_degree}"
            raise InvalidComplexError(message, "max_degree")
        if max_degree > 1:
            return chains.betti_numbers(self._simplices.values(), max_degree)
        rows = self._dual_rows(self._landmarks_by_nearness())
        (stage,) = homology.history(rows, [len(rows)])
        return stage.betti[: max_degree + 1]

    def euler_characteristic(self, *, max_terms: int = 100_000) -> int:
        """Return the Euler characteristic without listing faces.

        Parameters
        ----------
        max_terms : int, default 100000
            Effort after which to give up.

        Returns
        -------
        int
            The alternating sum of the face numbers; 0 for the empty complex.

        Raises
        ------
        ComputationLimitError
            If the complex is too dense for the effort allowed.
        """
        return euler.euler_characteristic(self._dual_rows(self._postings), max_terms=max_terms)

    def hop_balls(self, visible: Iterable[str], radii: Iterable[int]) -> list[frozenset[str]]:
        """Return the landmarks within some numbers of hops of a visible set.

        Parameters
        ----------
        visible : iterable of str
            Start of the search; unknown landmarks are ignored.
        radii : iterable of int
            Hops in the 1-skeleton, not negative, not decreasing; with `s_max` metres an edge,
            ``r_pseudo = radius * s_max``.

        Returns
        -------
        list of frozenset of str
            One ball for each radius.

        Raises
        ------
        InvalidComplexError
            If a radius is negative or the radii decrease.
        """
        wanted = list(radii)
        if any(later < earlier for earlier, later in zip([0, *wanted], wanted, strict=False)):
            message = f"hops must be non-negative and rising, not {wanted}"
            raise InvalidComplexError(message, "hops")
        rings = self._rings(observation(visible) & self._postings.keys())
        ball: set[str] = set(next(rings))
        balls: list[frozenset[str]] = []
        hops = 0
        for radius in wanted:
            while hops < radius:
                ball |= next(rings, frozenset())
                hops += 1
            balls.append(frozenset(ball))
        return balls

    def homology_of_balls(self, balls: Iterable[Iterable[str]]) -> list[homology.Stage]:
        """Return the homology of the full subcomplexes on growing sets of landmarks, in one pass.

        Parameters
        ----------
        balls : iterable of iterable of str
            Sets of landmarks of this complex, each inside the next, as `hop_balls` returns them.

        Returns
        -------
        list of Stage
            One for each set, with the barcode of their inclusions.
        """
        order: dict[str, None] = {}
        ends: list[int] = []
        for ball in balls:
            order.update(dict.fromkeys(sorted(set(ball) - order.keys())))
            ends.append(len(order))
        return homology.history(self._dual_rows(order), ends)

    def cycles(self) -> list[tuple[str, ...]]:
        """Return a short closed walk round each hole.

        Returns
        -------
        list of tuple of str
            As many as b1, shortest first: landmarks of which each was seen together with the next
            and the last with the first; as classes they are a basis of H_1.

        Examples
        --------
        >>> k = LandmarkComplex.from_observations([{"a", "b"}, {"b", "c"}, {"c", "a"}])
        >>> k.cycles()
        [('c', 'b', 'a')]
        """
        landmarks = self._landmarks_by_nearness()
        walks = cycles.shortest_cycles(self._dual_rows(landmarks))
        return [tuple(landmarks[index] for index in walk.simplices) for walk in walks]

    def induced(self, landmarks: Iterable[str]) -> Self:
        """Return the full subcomplex on some landmarks.

        It is generated by the intersections of all facets with the set, not by the facets
        inside the set.

        Parameters
        ----------
        landmarks : iterable of str
            Vertices to keep; unknown ones are ignored.

        Returns
        -------
        LandmarkComplex
            All simplices whose landmarks lie in the set.
        """
        kept = observation(landmarks)
        touched = {number for landmark in kept for number in self._postings.get(landmark, ())}
        return type(self).from_observations(
            self._simplices[number] & kept for number in sorted(touched)
        )

    def skeleton(self) -> "nx.Graph[str]":
        """Return the 1-skeleton: landmarks joined when seen together.

        Returns
        -------
        networkx.Graph
            Vertices and edges in sorted order.
        """
        graph: nx.Graph[str] = nx.Graph()
        graph.add_nodes_from(sorted(self._postings))
        for landmark in sorted(self._postings):
            later = sorted(other for other in self._neighbors(landmark) if other > landmark)
            graph.add_edges_from((landmark, other) for other in later)
        return graph

    def n_edges(self) -> int:
        """Return the number of edges of the 1-skeleton.

        Returns
        -------
        int
            Pairs of landmarks that were seen together.
        """
        ends = sum(len(self._neighbors(landmark)) for landmark in self._postings)
        return ends // 2

    def _neighbors(self, landmark: str) -> frozenset[str]:
        around: frozenset[str] = frozenset()
        return around.union(*(self._simplices[n] for n in self._postings[landmark])) - {landmark}

    def _rings(self, start: Simplex) -> Iterator[Simplex]:
        """Yield the landmarks at 0, 1, 2... hops; each facet is expanded once."""
        reached: set[str] = set(start)
        expanded: set[int] = set()
        ring = start
        while ring:
            yield ring
            entered = {n for landmark in ring for n in self._postings[landmark]} - expanded
            expanded |= entered
            found = frozenset().union(*(self._simplices[n] for n in entered))
            ring = found - reached
            reached |= ring
        yield ring

    def _landmarks_by_nearness(self) -> list[str]:
        """Return all landmarks so that neighbors stand close, which the engine likes."""
        order: dict[str, None] = {}
        for landmark in sorted(self._postings):
            if landmark not in order:
                for ring in self._rings(frozenset({landmark})):
                    order.update(dict.fromkeys(sorted(ring)))
        return list(order)

    def _dual_rows(self, landmarks: Iterable[str]) -> list[int]:
        """Return posting lists as bit masks over the facets that these landmarks touch."""
        position: dict[int, int] = {}
        rows: list[int] = []
        for landmark in landmarks:
            row = 0
            for number in sorted(self._postings[landmark]):
                row |= 1 << position.setdefault(number, len(position))
            rows.append(row)
        return rows


def _is_face(
    simplex: Simplex,
    simplices: Mapping[int, Simplex],
    postings: Mapping[str, frozenset[int]],
) -> bool:
    rarest = min((postings.get(landmark, frozenset()) for landmark in simplex), key=len)
    return any(simplex <= simplices[number] for number in rarest)


def _facets_inside(
    simplex: Simplex,
    simplices: Mapping[int, Simplex],
    postings: Mapping[str, frozenset[int]],
) -> list[int]:
    touched = set().union(*(postings.get(landmark, ()) for landmark in simplex))
    return [number for number in touched if simplices[number] <= simplex]
