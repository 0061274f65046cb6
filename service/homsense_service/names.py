"""Names that only come and never go, in one table that all versions share."""

from collections.abc import Iterable, Iterator


class Names:
    """A set that costs what joins it, not what is there.

    A version sees the first names of the table, whatever is appended later. One writer at a time;
    a version that is not the last one of its table goes on in a table of its own.
    """

    def __init__(self) -> None:
        self._table: dict[str, None] = {}
        self._size = 0

    def joined_by(self, names: Iterable[str]) -> "Names":
        """Return the version with some more names.

        Parameters
        ----------
        names : iterable of str
            Some of them may be there.

        Returns
        -------
        Names
            The next version.

        Examples
        --------
        >>> two = Names().joined_by("ab")
        >>> sorted(two.joined_by("bc")), sorted(two)
        (['a', 'b', 'c'], ['a', 'b'])
        """
        following = Names()
        is_last = self._size == len(self._table)
        following._table = self._table if is_last else dict.fromkeys(self)
        following._table.update(dict.fromkeys(names))
        following._size = len(following._table)
        return following

    def __len__(self) -> int:
        return self._size

    def __iter__(self) -> Iterator[str]:
        return iter(list(self._table)[: self._size])
