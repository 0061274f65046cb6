"""Where sites, maps and scans survive a restart."""

import json
import sqlite3
import threading
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Protocol

from homsense_service.errors import StoreError
from homsense_service.records import SiteConfig, StoredReading, StoredScan

_SCHEMA = """
CREATE TABLE IF NOT EXISTS site (id TEXT PRIMARY KEY, config TEXT NOT NULL) STRICT;
CREATE TABLE IF NOT EXISTS map (
    site TEXT PRIMARY KEY REFERENCES site ON DELETE CASCADE, document TEXT NOT NULL) STRICT;
CREATE TABLE IF NOT EXISTS scan (
    number INTEGER PRIMARY KEY,
    site TEXT NOT NULL REFERENCES site ON DELETE CASCADE,
    device TEXT NOT NULL, scan_id TEXT NOT NULL, observed_at REAL NOT NULL,
    readings TEXT NOT NULL, track TEXT,
    UNIQUE (site, device, scan_id)) STRICT;
"""


class Store(Protocol):
    """What the service asks of a store; every method returns when its effect is durable."""

    def sites(self) -> dict[str, SiteConfig]:
        """Return all sites."""
        ...

    def put_site(self, site: str, config: SiteConfig) -> None:
        """Create or replace a site's configuration."""
        ...

    def delete_site(self, site: str) -> None:
        """Delete a site with its map and scans."""
        ...

    def map_document(self, site: str) -> dict[str, Any] | None:
        """Return a site's map."""
        ...

    def put_map(self, site: str, document: dict[str, Any]) -> None:
        """Create or replace a site's map."""
        ...

    def add_scans(self, site: str, scans: Sequence[StoredScan]) -> list[bool]:
        """Append scans; tell for each whether it was new."""
        ...

    def scans(self, site: str) -> Iterator[StoredScan]:
        """Yield a site's scans in the order of arrival."""
        ...

    def close(self) -> None:
        """Release the data directory."""
        ...


class SqliteStore:
    """A store in one SQLite file that one process owns.

    Parameters
    ----------
    directory : pathlib.Path
        Created when absent.

    Raises
    ------
    StoreError
        If the directory cannot be used or another process holds it.
    """

    def __init__(self, directory: Path) -> None:
        self._lock = threading.Lock()
        try:
            directory.mkdir(parents=True, exist_ok=True)
            self._connection = sqlite3.connect(
                directory / "homsense.sqlite3", check_same_thread=False, timeout=1.0
            )
            self._connection.execute("PRAGMA locking_mode = EXCLUSIVE")
            self._connection.execute("PRAGMA journal_mode = WAL")
            self._connection.execute("PRAGMA synchronous = FULL")
            self._connection.execute("PRAGMA foreign_keys = ON")
            self._connection.executescript(_SCHEMA)
        except (OSError, sqlite3.Error) as error:
            message = f"the data directory {directory} cannot be used: {error}"
            raise StoreError(message) from error

    def sites(self) -> dict[str, SiteConfig]:
        """Return all sites."""
        try:
            with self._lock:
                statement = "SELECT id, config FROM site ORDER BY id"
                rows = self._connection.execute(statement).fetchall()
        except sqlite3.Error as error:
            message = f"the store does not answer: {error}"
            raise StoreError(message) from error
        return {site: _config(json.loads(text)) for site, text in rows}

    def put_site(self, site: str, config: SiteConfig) -> None:
        """Create or replace a site's configuration."""
        statement = (
            "INSERT INTO site (id, config) VALUES (?, ?) "
            "ON CONFLICT (id) DO UPDATE SET config = excluded.config"
        )
        with self._lock, self._connection:
            self._connection.execute(statement, (site, json.dumps(asdict(config))))

    def delete_site(self, site: str) -> None:
        """Delete a site with its map and scans."""
        with self._lock, self._connection:
            self._connection.execute("DELETE FROM site WHERE id = ?", (site,))

    def map_document(self, site: str) -> dict[str, Any] | None:
        """Return a site's map."""
        with self._lock:
            row = self._connection.execute(
                "SELECT document FROM map WHERE site = ?", (site,)
            ).fetchone()
        return None if row is None else json.loads(row[0])

    def put_map(self, site: str, document: dict[str, Any]) -> None:
        """Create or replace a site's map."""
        statement = (
            "INSERT INTO map VALUES (?, ?) "
            "ON CONFLICT (site) DO UPDATE SET document = excluded.document"
        )
        with self._lock, self._connection:
            self._connection.execute(statement, (site, json.dumps(document)))

    def add_scans(self, site: str, scans: Sequence[StoredScan]) -> list[bool]:
        """Append scans in one transaction; tell for each whether it was new."""
        statement = (
            "INSERT INTO scan (site, device, scan_id, observed_at, readings, track) "
            "VALUES (?, ?, ?, ?, ?, ?) ON CONFLICT DO NOTHING"
        )
        with self._lock, self._connection:
            return [
                self._connection.execute(statement, (site, *_row(scan))).rowcount == 1
                for scan in scans
            ]

    def scans(self, site: str) -> Iterator[StoredScan]:
        """Yield a site's scans in the order of arrival."""
        statement = (
            "SELECT device, scan_id, observed_at, readings, track FROM scan "
            "WHERE site = ? ORDER BY number"
        )
        with self._lock:
            rows = self._connection.execute(statement, (site,)).fetchall()
        for device, scan_id, observed_at, readings, track in rows:
            heard = tuple(StoredReading(*entry) for entry in json.loads(readings))
            yield StoredScan(device, scan_id, observed_at, heard, track and json.loads(track))

    def close(self) -> None:
        """Release the data directory."""
        with self._lock:
            self._connection.close()


def _row(scan: StoredScan) -> tuple[str, str, float, str, str | None]:
    readings = [(r.landmark, r.rssi_dbm, r.age_s) for r in scan.readings]
    text = json.dumps(readings, separators=(",", ":"))
    track = None if scan.track is None else json.dumps(scan.track)
    return scan.device, scan.scan_id, scan.observed_at, text, track


def _config(fields: dict[str, Any]) -> SiteConfig:
    listed = {name: tuple(value) for name, value in fields.items() if isinstance(value, list)}
    return SiteConfig(**{**fields, **listed})
