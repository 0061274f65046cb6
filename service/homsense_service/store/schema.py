"""The tables, made and changed by numbered files, one transaction for all of them."""

import json
import sqlite3
from importlib.resources import files

from homsense_service.errors import StoreError
from homsense_service.records import StoredReading
from homsense_service.store.landmarks import Landmarks
from homsense_service.store.packing import packed

VERSION = 3
_PACKED = 2


def migrate(connection: sqlite3.Connection) -> None:
    """Bring a database to the newest form.

    Parameters
    ----------
    connection : sqlite3.Connection
        In autocommit mode.

    Raises
    ------
    StoreError
        If a later release has written it.
    """
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    if version > VERSION:
        message = f"the store has form {version}, this release knows {VERSION} at most"
        raise StoreError(message)
    if version == VERSION:
        return
    connection.execute("PRAGMA foreign_keys = OFF")
    connection.execute("BEGIN IMMEDIATE")
    for number in range(version + 1, VERSION + 1):
        text = files("homsense_service.store").joinpath("migrations", f"{number:04}.sql")
        for statement in text.read_text().split(";\n"):
            connection.execute(statement)
    if version < _PACKED:
        _pack_scans(connection)
    connection.execute(f"PRAGMA user_version = {VERSION}")
    connection.execute("COMMIT")
    connection.execute("PRAGMA foreign_keys = ON")


def _pack_scans(connection: sqlite3.Connection) -> None:
    """Move the scans of the first form, whose readings are JSON."""
    landmarks = Landmarks()
    found = connection.execute(
        "SELECT s.number, o.device, o.scan_id, o.observed_at, o.readings, o.track "
        "FROM scan_1 o JOIN site s ON s.name = o.site ORDER BY o.number"
    )
    for site, device, scan_id, observed_at, text, track in found:
        readings = [StoredReading(*entry) for entry in json.loads(text)]
        body = packed(readings, landmarks.numbering(connection, site))
        connection.execute(
            "INSERT INTO scan (site, device, scan_id, observed_at, readings, track) "
            "VALUES (?, ?, ?, ?, ?, ?)",
            (site, device, scan_id, observed_at, body, track),
        )
    for table in ("scan_1", "map_1", "site_1"):
        connection.execute(f"DROP TABLE {table}")
