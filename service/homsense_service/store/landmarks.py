"""Names of landmarks as numbers."""

import sqlite3
from collections.abc import Callable


class Landmarks:
    """What the writer knows of the numbers of landmarks; the table is the truth."""

    def __init__(self) -> None:
        self._known: dict[int, dict[str, int]] = {}

    def forget(self, site: int | None = None) -> None:
        """Read again from the table: of a site, or of all."""
        if site is None:
            self._known.clear()
        else:
            self._known.pop(site, None)

    def numbering(self, connection: sqlite3.Connection, site: int) -> Callable[[str], int]:
        """Return what gives the number of a landmark of a site, a new one when it has none.

        Parameters
        ----------
        connection : sqlite3.Connection
            Within a transaction; when that is lost, `forget`.
        site : int
            Number of the site.

        Returns
        -------
        callable
            From name to number.
        """
        if site not in self._known:
            found = connection.execute("SELECT name, number FROM landmark WHERE site = ?", (site,))
            self._known[site] = dict(found)
        known = self._known[site]

        def number_of(name: str) -> int:
            number = known.get(name)
            if number is None:
                inserted = connection.execute(
                    "INSERT INTO landmark (site, name) VALUES (?, ?)", (site, name)
                )
                known[name] = number = inserted.lastrowid or 0
            return number

        return number_of
