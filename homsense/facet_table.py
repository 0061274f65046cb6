"""The facets of a growing complex in arrays that readers share with one writer, without a lock.

Two tables hold the complex: *rows* (facet -> landmarks) and *postings* (landmark -> facets), the
Dowker dual. Everything is appended. A facet that a larger one swallows stays where it is and
remembers which one did. So a version is a number n: it sees the facets below n that no facet
below n has swallowed, whatever is appended later.

A posting list is a region of one array: its capacity, its entries, `NEVER` behind them. A list
that is full moves to a region of twice the size; the old region stays as it is for its readers.
"""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from homsense.ragged import spread

Whole = TypeVar("Whole", np.int32, np.int64)
Numbers = NDArray[np.int32]
Offsets = NDArray[np.int64]

NEVER = int(np.iinfo(np.int32).max)
_NO_REGION = 0
_SPARE = 256


class Ragged(NamedTuple):
    """Lists of different lengths, one after the other.

    Parameters
    ----------
    ends : ndarray, shape (n + 1,), int64
        List i is ``values[ends[i]:ends[i + 1]]``.
    values : ndarray, int32
        All entries.
    """

    ends: Offsets
    values: Numbers

    @classmethod
    def of(cls, lists: Iterable[Sequence[int]]) -> Self:
        """Return lists in this form.

        Parameters
        ----------
        lists : iterable of sequence of int
            The lists.

        Returns
        -------
        Ragged
            The same numbers.
        """
        kept = list(lists)
        ends = np.zeros(len(kept) + 1, np.int64)
        np.cumsum([len(entries) for entries in kept], out=ends[1:])
        return cls(ends, np.array([n for entries in kept for n in entries], np.int32))

    def lists(self) -> list[list[int]]:
        """Return the lists as Python has them.

        Returns
        -------
        list of list of int
            One list for each.
        """
        values, ends = self.values.tolist(), self.ends.tolist()
        return [values[start:end] for start, end in pairwise(ends)]


class Version(NamedTuple):
    """The tables as a reader of one version sees them; see the head of this file.

    Parameters
    ----------
    row_start : ndarray, int64
        Facet f holds ``points[row_start[f]:row_start[f + 1]]``.
    points : ndarray, int32
        Landmark numbers, rising within a facet.
    swallowed_by : ndarray, int32
        The facet that swallowed a facet, or `NEVER`.
    posting_start : ndarray, int64
        Where the region of a landmark starts.
    postings : ndarray, int32
        Regions: capacity, facet numbers rising, `NEVER`.
    n_facets, n_landmarks : int
        How many there were when this version was made.
    """

    row_start: Offsets
    points: Numbers
    swallowed_by: Numbers
    posting_start: Offsets
    postings: Numbers
    n_facets: int
    n_landmarks: int

    def live(self) -> Numbers:
        """Return the facets of this version, rising.

        Returns
        -------
        ndarray, int32
            Facet numbers.
        """
        alive = self.swallowed_by[: self.n_facets] >= self.n_facets
        return np.flatnonzero(alive).astype(np.int32)

    def rows(self, facets: Numbers) -> Ragged:
        """Return the landmarks of some facets.

        Parameters
        ----------
        facets : ndarray, int32
            Facet numbers.

        Returns
        -------
        Ragged
            One list for each facet.
        """
        starts = self.row_start[facets]
        ends, places = spread(starts, self.row_start[facets + 1] - starts)
        return Ragged(ends, self.points[places])

    def posting_lists(self, landmarks: Numbers) -> Ragged:
        """Return the facets through some landmarks.

        Parameters
        ----------
        landmarks : ndarray, int32
            Landmark numbers.

        Returns
        -------
        Ragged
            One rising list for each landmark.
        """
        ends, found = self._regions(landmarks)
        seen = found < self.n_facets
        seen[seen] = self.swallowed_by[found[seen]] >= self.n_facets
        return Ragged(np.concatenate([[0], np.cumsum(seen)])[ends], found[seen])

    def last_change(self, landmarks: Numbers) -> int:
        """Return the highest number of a facet that was ever appended through some landmarks.

        Parameters
        ----------
        landmarks : ndarray, int32
            Landmark numbers.

        Returns
        -------
        int
            A facet number, or -1.
        """
        _, found = self._regions(landmarks)
        return int(found[found < self.n_facets].max(initial=-1))

    def _regions(self, landmarks: Numbers) -> Ragged:
        """Return all that stands in the regions of some landmarks."""
        starts = self.posting_start[landmarks]
        ends, places = spread(starts + 1, self.postings[starts].astype(np.int64))
        return Ragged(ends, self.postings[places])


class FacetTable:
    """The writer's side of the tables; whoever `claim` admits may append.

    Examples
    --------
    >>> table = FacetTable()
    >>> a, b, c = (table.number(name) for name in "abc")
    >>> table.append(np.array([a, b], np.int32))
    >>> before = table.version()
    >>> table.append(np.array([a, b, c], np.int32), swallowing=[0])
    >>> before.live().tolist(), table.version().live().tolist()
    ([0], [1])
    """

    def __init__(self) -> None:
        self.names: list[str] = []
        self.numbers: dict[str, int] = {}
        self.row_start = np.zeros(17, np.int64)
        self.points = np.empty(64, np.int32)
        self.swallowed_by = np.full(16, NEVER, np.int32)
        self.posting_start = np.full(16, _NO_REGION, np.int64)
        self.postings = np.full(64, NEVER, np.int32)
        self.postings[_NO_REGION] = 0
        self.used = np.zeros(16, np.int32)
        self.tally = np.zeros(16, np.int32)
        self.n_facets = 0
        self.n_postings = 2
        self.n_swallowed_points = 0
        self.workspace: object = None
        self._free = [True]

    @classmethod
    def holding(cls, version: Version, names: Sequence[str]) -> Self:
        """Return a table of the facets of a version only, as small as it can be.

        Parameters
        ----------
        version : Version
            What to copy.
        names : sequence of str
            The names of its landmarks by number.

        Returns
        -------
        FacetTable
            A writer of its own.
        """
        return cls.of(version.rows(version.live()), names[: version.n_landmarks])

    @classmethod
    def of(cls, rows: Ragged, names: Sequence[str]) -> Self:
        """Return a table of some facets.

        Parameters
        ----------
        rows : Ragged
            Landmark numbers of each facet, rising; none lies in another.
        names : sequence of str
            The names of the landmarks by number.

        Returns
        -------
        FacetTable
            A writer of its own.
        """
        table = cls()
        table.names = list(names)
        table.numbers = {name: number for number, name in enumerate(table.names)}
        n_facets, n_landmarks = len(rows.ends) - 1, len(table.names)
        table.n_facets, table.row_start, table.points = n_facets, rows.ends, rows.values
        table.swallowed_by = np.full(n_facets, NEVER, np.int32)
        table.tally = np.zeros(n_facets, np.int32)
        facet_of = np.repeat(np.arange(n_facets, dtype=np.int32), np.diff(rows.ends))
        by_landmark = np.argsort(rows.values, kind="stable")
        counts = np.bincount(rows.values, minlength=n_landmarks)
        table.used = counts.astype(np.int32)
        table.posting_start = np.cumsum(counts + 2) - counts
        table.n_postings = 2 + len(by_landmark) + 2 * n_landmarks
        table.postings = np.full(table.n_postings, NEVER, np.int32)
        table.postings[_NO_REGION] = 0
        table.postings[table.posting_start] = counts
        _, places = spread(table.posting_start + 1, counts.astype(np.int64))
        table.postings[places] = facet_of[by_landmark]
        return table

    def version(self) -> Version:
        """Return what has been appended so far.

        Returns
        -------
        Version
            Never changes.
        """
        return Version(
            self.row_start,
            self.points,
            self.swallowed_by,
            self.posting_start,
            self.postings,
            self.n_facets,
            len(self.names),
        )

    def claim(self, version: Version) -> bool:
        """Ask to append behind a version.

        Parameters
        ----------
        version : Version
            What the caller has.

        Returns
        -------
        bool
            False when somebody else is appending, or has appended behind that version.
        """
        try:
            self._free.pop()
        except IndexError:
            return False
        if (self.n_facets, len(self.names)) == (version.n_facets, version.n_landmarks):
            return True
        self.release()
        return False

    def release(self) -> None:
        """Let the next one append."""
        self._free.append(True)

    @property
    def is_wasteful(self) -> bool:
        """Whether more than half of the room is taken by what no new version sees."""
        live = int(self.row_start[self.n_facets]) - self.n_swallowed_points
        idle = self.n_swallowed_points + self.n_postings - live - 2 * len(self.names)
        return idle > 2 * live + _SPARE

    @property
    def n_bytes(self) -> int:
        """The bytes that the arrays take, names of landmarks not counted."""
        arrays = (*self.version()[:5], self.used, self.tally)
        return sum(array.nbytes for array in arrays)

    def number(self, name: str) -> int:
        """Return the number of a landmark, a new one when it was never named.

        Parameters
        ----------
        name : str
            Identifier.

        Returns
        -------
        int
            Its number.
        """
        known = self.numbers.get(name)
        if known is not None:
            return known
        fresh = len(self.names)
        if fresh >= len(self.posting_start):
            self.posting_start = _grown(self.posting_start, fresh + 1, _NO_REGION)
            self.used = _grown(self.used, fresh + 1, 0)
        self.names.append(name)
        self.numbers[name] = fresh
        return fresh

    def reserve(self, facets: int, points: int, postings: int) -> None:
        """Make room.

        Parameters
        ----------
        facets, points, postings : int
            How many more of each.
        """
        facets += self.n_facets
        if facets > len(self.swallowed_by):
            self.row_start = _grown(self.row_start, facets + 1, 0)
            self.swallowed_by = _grown(self.swallowed_by, facets, NEVER)
            self.tally = _grown(self.tally, facets, 0)
        points += int(self.row_start[self.n_facets])
        if points > len(self.points):
            self.points = _grown(self.points, points, 0)
        if self.n_postings + postings > len(self.postings):
            self.postings = _grown(self.postings, self.n_postings + postings, NEVER)
            self.posting_start = self.posting_start.copy()

    def append(self, row: Numbers, swallowing: Sequence[int] = ()) -> None:
        """Append a facet that lies in no other one.

        Parameters
        ----------
        row : ndarray, int32
            Its landmarks, rising.
        swallowing : sequence of int
            The facets that lie in it.
        """
        self.reserve(1, len(row), 0)
        facet, start = self.n_facets, int(self.row_start[self.n_facets])
        self.points[start : start + len(row)] = row
        self.row_start[facet + 1] = start + len(row)
        for landmark in row.tolist():
            self._post(landmark, facet)
        for swallowed in swallowing:
            self.swallowed_by[swallowed] = facet
            length = self.row_start[swallowed + 1] - self.row_start[swallowed]
            self.n_swallowed_points += int(length)
        self.n_facets += 1

    def _post(self, landmark: int, facet: int) -> None:
        start, count = int(self.posting_start[landmark]), int(self.used[landmark])
        if count == self.postings[start]:
            capacity = max(2, 2 * count)
            self.reserve(0, 0, capacity + 2)
            moved = self.n_postings
            self.postings[moved] = capacity
            self.postings[moved + 1 : moved + 1 + count] = self.postings[
                start + 1 : start + 1 + count
            ]
            self.n_postings += capacity + 2
            self.posting_start[landmark] = start = moved
        self.postings[start + 1 + count] = facet
        self.used[landmark] = count + 1


def _grown(array: NDArray[Whole], needed: int, fill: int) -> NDArray[Whole]:
    """Return a longer copy; the old array stays as it is for its readers."""
    longer = np.full(max(needed, 2 * len(array)), fill, array.dtype)
    longer[: len(array)] = array
    return longer
