"""The landmark complex, kept as its facets; a value that only ever grows.

A *facet* is a maximal simplex; `homsense.facet_table` holds them. No face is ever listed. This
file knows the names of the landmarks; below it they are numbers.
"""

import hashlib
import json
from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import Self

import numpy as np

from homsense import chains, euler, neighborhood
from homsense.engine import Engine, fastest
from homsense.errors import InvalidComplexError
from homsense.facet_table import FacetTable, Numbers, Ragged, Version
from homsense.history import History, bit_masks
from homsense.neighborhood import Neighborhoods
from homsense.scan import observation

Simplex = frozenset[str]

_NOBODY = np.empty(0, np.int32)


class LandmarkComplex:
    """A simplicial complex on landmarks: the simplices are the sets that were seen together.

    Equal complexes compare, hash and digest equal, however they were built. A version is never
    changed by what is observed later, and may be read while another thread adds to it.

    Parameters
    ----------
    engine : Engine, optional
        What runs the hot loops, here and in all versions that follow; the fastest by default.
    table : FacetTable, optional
        The facets; none by default.

    Examples
    --------
    >>> k = LandmarkComplex.from_observations([{"a", "b"}, {"b", "c"}, {"a", "c"}])
    >>> k.betti_numbers(), k.euler_characteristic()
    ((1, 1), 0)
    >>> k.with_observation({"a", "b", "c"}).betti_numbers()
    (1, 0)
    """

    __slots__ = ("_engine", "_table", "_version")

    def __init__(self, engine: Engine | None = None, table: FacetTable | None = None) -> None:
        self._engine = engine or fastest()
        self._table = table or FacetTable()
        self._version = self._table.version()

    @classmethod
    def from_observations(
        cls, observations: Iterable[Iterable[str]], engine: Engine | None = None
    ) -> Self:
        """Return the landmark complex of some observations (Algorithm 2, buildLandmarkComplex).

        Parameters
        ----------
        observations : iterable of iterable of str
            The landmarks in view at each observation; order and repetition do not matter.
        engine : Engine, optional
            What runs the hot loops; the fastest by default.

        Returns
        -------
        LandmarkComplex
            The nerve.

        Raises
        ------
        InvalidScanError
            If an identifier is not a non-empty string.
        """
        return cls(engine).with_observations(observations)

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
        seen = [simplex for simplex in map(observation, observations) if simplex]
        if not seen:
            return self
        table = self._claimed()
        before = table.n_facets
        try:
            scans = Ragged.of([sorted(map(table.number, simplex)) for simplex in seen])
            self._engine.insert(table, scans)
            if table.n_facets == before:
                return self
            grown = type(self)(self._engine, table)
        finally:
            table.release()
        if table.is_wasteful:
            grown = type(self)(self._engine, FacetTable.holding(grown._version, table.names))
        return grown

    def _claimed(self) -> FacetTable:
        """Return a table to append to: this one, or a copy when somebody else appends to it."""
        if self._table.claim(self._version):
            return self._table
        copy = FacetTable.holding(self._version, self._table.names)
        copy.claim(copy.version())
        return copy

    def run_by(self, engine: Engine) -> Self:
        """Return the same complex, run by another engine.

        Parameters
        ----------
        engine : Engine
            What runs the hot loops from now on.

        Returns
        -------
        LandmarkComplex
            Equal to this one.
        """
        if engine is self._engine:
            return self
        same = type(self)(engine, self._table)
        same._version = self._version
        return same

    def __or__(self, other: "LandmarkComplex") -> Self:
        """Return the union: the complex of the observations of both."""
        if not isinstance(other, LandmarkComplex):
            return NotImplemented
        return self.with_observations(other.facets)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, LandmarkComplex):
            return NotImplemented
        return self.facets == other.facets

    def __hash__(self) -> int:
        return hash(self.facets)

    def __contains__(self, simplex: Iterable[str]) -> bool:
        """Tell whether a set of landmarks is a simplex; the empty set is none."""
        wanted = observation(simplex)
        numbers = self.numbers(wanted)
        if not wanted or len(numbers) < len(wanted):
            return False
        _, shared = np.unique(self._version.posting_lists(numbers).values, return_counts=True)
        return bool(np.any(shared == len(numbers)))

    def __repr__(self) -> str:
        return f"<LandmarkComplex: {self.n_landmarks} landmarks, {self.n_facets} facets>"

    @property
    def facets(self) -> frozenset[Simplex]:
        """The maximal simplices."""
        return frozenset(map(frozenset, self._named_facets()))

    @property
    def landmarks(self) -> frozenset[str]:
        """The vertices: all landmarks that were ever observed."""
        return frozenset(self.numbered)

    @property
    def numbered(self) -> list[str]:
        """The vertices by number."""
        return self._table.names[: self.n_landmarks]

    @property
    def version(self) -> Version:
        """The tables behind this version."""
        return self._version

    @property
    def n_facets(self) -> int:
        """The number of maximal simplices."""
        return len(self._version.live())

    @property
    def n_landmarks(self) -> int:
        """The number of vertices."""
        return self._version.n_landmarks

    def digest(self) -> str:
        """Return a canonical hash: equal for equal complexes, in any process.

        Returns
        -------
        str
            SHA-256 of the facets in lexicographic order, hexadecimal.
        """
        ordered = sorted(map(sorted, self._named_facets()))
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
            return chains.betti_numbers(self.facets, max_degree)
        order = neighborhood.nearness_order(self._version)
        return self.homology_along(order, [len(order)]).betti(0)[: max_degree + 1]

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
        landmarks = np.arange(self.n_landmarks, dtype=np.int32)
        rows = bit_masks(neighborhood.dual_rows(self._version, landmarks))
        return euler.euler_characteristic(rows, max_terms=max_terms)

    def sense(
        self, visible: Iterable[str], radii: Iterable[int], without: Collection[str] = ()
    ) -> Neighborhoods:
        """Return the hop neighborhoods of a visible set with their homology, in one pass.

        Parameters
        ----------
        visible : iterable of str
            Start of the search; unknown landmarks are ignored.
        radii : iterable of int
            Hops in the 1-skeleton, not negative, not decreasing.
        without : collection of str
            Landmarks that are left out of the complex.

        Returns
        -------
        Neighborhoods
            One for each radius; `names` tells which landmarks are meant.

        Raises
        ------
        InvalidComplexError
            If a radius is negative or the radii decrease.
        """
        wanted = neighborhood.rising(radii)
        seeds = self.numbers(observation(visible))
        left_out = self.numbers(without) if without else _NOBODY
        return self._engine.sense(self._table, self._version, seeds, wanted, left_out)

    def homology_along(self, order: Numbers, ends: Sequence[int]) -> History:
        """Return the homology of the full subcomplexes on the first landmarks of an order.

        Parameters
        ----------
        order : ndarray, int32
            Numbers of landmarks.
        ends : sequence of int
            How many of them each subcomplex has, not falling.

        Returns
        -------
        History
            One place for each end.
        """
        return self._engine.history(neighborhood.dual_rows(self._version, order), ends)

    def numbers(self, names: Iterable[str]) -> Numbers:
        """Return the numbers of the landmarks that this version knows.

        Parameters
        ----------
        names : iterable of str
            Identifiers; unknown ones are left out.

        Returns
        -------
        ndarray, int32
            Their numbers.
        """
        known, count = self._table.numbers, self.n_landmarks
        numbers = [n for name in names if (n := known.get(name, count)) < count]
        return np.array(numbers, np.int32)

    def names(self, numbers: Numbers) -> frozenset[str]:
        """Return the identifiers of some landmarks.

        Parameters
        ----------
        numbers : ndarray, int32
            Numbers, as `sense` returns them.

        Returns
        -------
        frozenset of str
            Identifiers.
        """
        names = self._table.names
        return frozenset([names[number] for number in numbers.tolist()])

    def agrees_on(self, earlier: "LandmarkComplex", numbers: Numbers) -> bool:
        """Tell whether nothing has changed at some landmarks since an earlier version.

        Parameters
        ----------
        earlier : LandmarkComplex
            The version that `numbers` belong to.
        numbers : ndarray, int32
            Numbers of landmarks, as `sense` returns them.

        Returns
        -------
        bool
            True when every facet through them is the same in both; False also when that cannot be
            told cheaply, because the facets were copied in between.
        """
        if self._table is not earlier._table:
            return False
        before, now = earlier._version.n_facets, self._version
        return before == now.n_facets or now.last_change(numbers) < before

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
        kept = self.numbers(observation(landmarks))
        touched = np.unique(self._version.posting_lists(kept).values)
        inside = np.zeros(self.n_landmarks, np.bool_)
        inside[kept] = True
        names = self._table.names
        rows = self._version.rows(touched).lists()
        shared = [[names[number] for number in row if inside[number]] for row in rows]
        return type(self).from_observations(shared, self._engine)

    def _named_facets(self) -> Iterator[list[str]]:
        for row in self._version.rows(self._version.live()).lists():
            yield [self._table.names[number] for number in row]
