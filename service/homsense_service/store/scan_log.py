"""The log of scans in SQL; each function is a job for the writer, or reads."""

import json
import sqlite3
from collections.abc import Iterator, Sequence

from homsense_service.errors import SiteNotFoundError
from homsense_service.records import Checkpoint, NumberedScan, StoredScan
from homsense_service.store.landmarks import Landmarks
from homsense_service.store.packing import landmark_numbers, packed, unpacked

_INSERT = (
    "INSERT INTO scan (site, device, scan_id, observed_at, readings, track) "
    "VALUES (?, ?, ?, ?, ?, ?) ON CONFLICT DO NOTHING"
)
_OF_SITE = (
    "SELECT number, device, scan_id, observed_at, readings, track FROM scan WHERE site = ?1 AND"
)

AFTER = "number > ?2"
EVENLY = (
    "number IN (SELECT number FROM "
    "(SELECT number, ROW_NUMBER() OVER (ORDER BY number) - 1 AS place, COUNT(*) OVER () AS total "
    "FROM scan WHERE site = ?1) WHERE place % ((total + ?2 - 1) / ?2) = 0)"
)
LATEST = "number IN (SELECT number FROM scan WHERE site = ?1 ORDER BY number DESC LIMIT ?2)"
OF_DEVICE = "DELETE FROM scan WHERE site = ? AND device = ?"
BEFORE = "DELETE FROM scan WHERE site = ? AND observed_at < ?"


def site_number(connection: sqlite3.Connection, site: str) -> int:
    """Return the number of a site or raise `SiteNotFoundError`."""
    row = connection.execute("SELECT number FROM site WHERE name = ?", (site,)).fetchone()
    if row is None:
        raise SiteNotFoundError(site)
    return int(row[0])


def add_scans(
    connection: sqlite3.Connection, landmarks: Landmarks, site: str, scans: Sequence[StoredScan]
) -> list[NumberedScan | None]:
    """Append scans; return those that were new, and None for each of the others."""
    of_site = site_number(connection, site)
    number_of = landmarks.numbering(connection, of_site)
    added: list[NumberedScan | None] = []
    for scan in scans:
        track = None if scan.track is None else json.dumps(scan.track)
        body = packed(scan.readings, number_of)
        row = (of_site, scan.device, scan.scan_id, scan.observed_at, body, track)
        done = connection.execute(_INSERT, row)
        added.append(NumberedScan(done.lastrowid or 0, scan) if done.rowcount else None)
    return added


def scans(
    connection: sqlite3.Connection, site: str, which: str, value: int
) -> Iterator[NumberedScan]:
    """Yield scans of a site by one of `AFTER`, `EVENLY`, `LATEST`, in the order of the log."""
    connection.execute("BEGIN")
    try:
        of_site = site_number(connection, site)
        rows = connection.execute(f"{_OF_SITE} {which} ORDER BY number", (of_site, value))
        names: dict[int, str] = {}
        for number, device, scan_id, observed_at, body, track in rows:
            if not names:
                names = dict(
                    connection.execute(
                        "SELECT number, name FROM landmark WHERE site = ?", (of_site,)
                    )
                )
            readings = unpacked(body, names.__getitem__)
            scan = StoredScan(device, scan_id, observed_at, readings, track and json.loads(track))
            yield NumberedScan(number, scan)
    finally:
        connection.execute("ROLLBACK")


def delete_scans(
    connection: sqlite3.Connection,
    landmarks: Landmarks,
    site: str,
    statement: str,
    value: str | float,
) -> int:
    """Delete scans by one of `OF_DEVICE`, `BEFORE`, and the names that only they had.

    The checkpoint that they are in goes too.
    """
    of_site = site_number(connection, site)
    deleted = connection.execute(f"{statement} RETURNING readings", (of_site, value)).fetchall()
    if deleted:
        gone = {number for (body,) in deleted for number in landmark_numbers(body)}
        left = connection.execute("SELECT readings FROM scan WHERE site = ?", (of_site,))
        while gone and (row := left.fetchone()):
            gone.difference_update(landmark_numbers(row[0]))
        left.close()
        connection.executemany("DELETE FROM landmark WHERE number = ?", [(name,) for name in gone])
        connection.execute("DELETE FROM checkpoint WHERE site = ?", (of_site,))
        landmarks.forget(of_site)
    return len(deleted)


def checkpoint(connection: sqlite3.Connection, site: str) -> Checkpoint | None:
    """Return the last checkpoint of a site."""
    row = connection.execute(
        "SELECT through, key, body FROM checkpoint WHERE site = ?",
        (site_number(connection, site),),
    ).fetchone()
    return None if row is None else Checkpoint(*row)


def put_checkpoint(connection: sqlite3.Connection, site: str, made: Checkpoint) -> None:
    """Replace the checkpoint of a site."""
    connection.execute(
        "INSERT OR REPLACE INTO checkpoint VALUES (?, ?, ?, ?)",
        (site_number(connection, site), made.through, made.key, made.body),
    )
