"""A store in one SQLite file that one process owns.

One connection writes and checkpoints, in its own thread; each reader has a connection of its own
that can do neither. (SQLite before 3.51.3 may corrupt a file when two connections checkpoint.)
"""

import json
import sqlite3
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

from homsense_service.errors import KeyExistsError, KeyNotFoundError, StoreError
from homsense_service.records import (
    Binding,
    Checkpoint,
    Event,
    KeyRecord,
    NumberedScan,
    SessionRecord,
    SiteRecord,
    Snapshot,
    StoredScan,
    config_of,
)
from homsense_service.store import bindings, journal, scan_log
from homsense_service.store.contract import Artifacts, Committed
from homsense_service.store.landmarks import Landmarks
from homsense_service.store.schema import migrate
from homsense_service.store.wal import has_ragged_end
from homsense_service.store.writer import Job, Writer

Result = TypeVar("Result")

_MENDED = (3, 51, 3)


class SqliteStore:
    """A store in a directory.

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
        self._path = directory / "homsense.sqlite3"
        try:
            directory.mkdir(parents=True, exist_ok=True)
            self._ownership = _owned(directory / "owner.lock")
        except (OSError, sqlite3.Error) as error:
            message = f"the data directory {directory} cannot be used: {error}"
            raise StoreError(message) from error
        try:
            connection = sqlite3.connect(
                self._path, check_same_thread=False, isolation_level=None, timeout=1.0
            )
            for name, value in (
                ("page_size", 16384),
                ("journal_mode", "WAL"),
                ("synchronous", "FULL"),
                ("foreign_keys", "ON"),
                ("wal_autocheckpoint", 4000),
            ):
                connection.execute(f"PRAGMA {name} = {value}")
            self._has_ragged_end = has_ragged_end(connection, self._path)
            migrate(connection)
        except (sqlite3.Error, StoreError) as error:
            self._ownership.close()
            message = f"the data directory {directory} cannot be used: {error}"
            raise StoreError(message) from error
        self._landmarks = Landmarks()
        self._writer = Writer(connection, time.monotonic, self._landmarks.forget)

    def watch(self, on_commit: Callable[[float, int], None]) -> None:
        """Tell from now on of each transaction."""
        self._writer.on_commit = on_commit

    @property
    def caution(self) -> str | None:
        """What an operator should know about it, if anything."""
        told = []
        if sqlite3.sqlite_version_info < _MENDED:
            told.append(
                f"SQLite {sqlite3.sqlite_version} is older than 3.51.3, see docs/operation.md"
            )
        if self._has_ragged_end:
            told.append(
                "the write-ahead log ends in the middle of a transaction, which is left out: it "
                "was never acknowledged unless the disk has failed"
            )
        return "; ".join(told) or None

    def check(self) -> None:
        """Raise `StoreError` when the store does not answer."""
        self._writer.check()
        self.sites()

    def damage(self) -> list[str]:
        """Return what is wrong with the file; reads all of it."""
        found = self._read(lambda db: db.execute("PRAGMA integrity_check").fetchall())
        found += self._read(lambda db: db.execute("PRAGMA foreign_key_check").fetchall())
        return [str(row[0]) for row in found if row[0] != "ok"]

    def age_s(self) -> float:
        """Return how long the transaction at hand goes on, seconds."""
        return self._writer.age_s()

    def sites(self) -> dict[str, SiteRecord]:
        """Return all sites."""
        rows = self._read(
            lambda db: db.execute("SELECT name, config, revision FROM site").fetchall()
        )
        return {name: SiteRecord(config_of(json.loads(text)), at) for name, text, at in rows}

    def put_site(self, site: str, record: SiteRecord) -> None:
        """Create a site or replace its configuration."""
        statement = (
            "INSERT INTO site (name, config, revision) VALUES (?, ?, ?) ON CONFLICT (name) "
            "DO UPDATE SET config = excluded.config, revision = excluded.revision"
        )
        row = site, json.dumps(asdict(record.config)), record.revision
        self._write(lambda db: _done(db.execute(statement, row)))

    def delete_site(self, site: str) -> None:
        """Delete a site with its map, scans and sessions."""

        def job(db: sqlite3.Connection) -> None:
            number = scan_log.site_number(db, site)
            db.execute("DELETE FROM site WHERE number = ?", (number,))
            journal.drop_unused_artifacts(db)
            self._landmarks.forget(number)

        self._write(job)

    def map_document(self, site: str) -> dict[str, Any] | None:
        """Return a site's map."""
        statement = (
            "SELECT document FROM map WHERE site = (SELECT number FROM site WHERE name = ?)"
        )
        row = self._read(lambda db: db.execute(statement, (site,)).fetchone())
        return None if row is None else json.loads(row[0])

    def put_map(self, site: str, document: dict[str, Any], revision: int) -> None:
        """Replace a site's map."""
        text = json.dumps(document)

        def job(db: sqlite3.Connection) -> None:
            number = scan_log.site_number(db, site)
            db.execute("INSERT OR REPLACE INTO map VALUES (?, ?)", (number, text))
            db.execute("UPDATE site SET revision = ? WHERE number = ?", (revision, number))

        self._write(job)

    def add_scans(
        self, site: str, scans: Sequence[StoredScan], committed: Committed
    ) -> list[bool]:
        """Append scans; tell for each whether it was new."""
        added = self._write(
            lambda db: scan_log.add_scans(db, self._landmarks, site, scans),
            lambda found: committed([scan for scan in found if scan is not None]),
        )
        return [scan is not None for scan in added]

    def scans(self, site: str, after: int = 0) -> Iterator[NumberedScan]:
        """Yield a site's scans in the order of the log, from behind a number."""
        with self._reading() as db:
            yield from scan_log.scans(db, site, scan_log.AFTER, after)

    def even_scans(self, site: str, most: int) -> list[StoredScan]:
        """Return scans of a site, evenly over the log."""
        return self._some(site, scan_log.EVENLY, most)

    def latest_scans(self, site: str, most: int) -> list[StoredScan]:
        """Return the last scans of a site."""
        return self._some(site, scan_log.LATEST, most)

    def _some(self, site: str, which: str, most: int) -> list[StoredScan]:
        with self._reading() as db:
            return [entry.scan for entry in scan_log.scans(db, site, which, most)]

    def delete_scans(self, site: str, device: str) -> int:
        """Delete the scans of a device."""
        return self._write(
            lambda db: scan_log.delete_scans(db, self._landmarks, site, scan_log.OF_DEVICE, device)
        )

    def expire_scans(self, site: str, before_s: float) -> int:
        """Delete the scans that were observed before a moment."""
        return self._write(
            lambda db: scan_log.delete_scans(db, self._landmarks, site, scan_log.BEFORE, before_s)
        )

    def checkpoint(self, site: str) -> Checkpoint | None:
        """Return a site's last checkpoint."""
        return self._read(lambda db: scan_log.checkpoint(db, site))

    def put_checkpoint(self, site: str, checkpoint: Checkpoint) -> None:
        """Replace a site's checkpoint."""
        self._write(lambda db: scan_log.put_checkpoint(db, site, checkpoint))

    def sessions(self) -> list[SessionRecord]:
        """Return all sessions that were not closed."""
        return self._read(journal.sessions)

    def open_session(self, record: SessionRecord, artifacts: Artifacts) -> None:
        """Keep a session with what it refers to."""
        self._write(lambda db: journal.open_session(db, record, artifacts))

    def close_session(self, session: str) -> None:
        """Delete a session and what it alone refers to."""
        self._write(lambda db: journal.close_session(db, session))

    def journal(
        self,
        session: str,
        events: Sequence[Event],
        *,
        scans: tuple[str, Sequence[StoredScan], Committed] | None = None,
        artifacts: Artifacts | None = None,
    ) -> None:
        """Append events to a session and, in the same transaction, scans to a site."""

        def job(db: sqlite3.Connection) -> list[NumberedScan | None]:
            journal.append(db, session, events, artifacts)
            if scans is None:
                return []
            return scan_log.add_scans(db, self._landmarks, scans[0], scans[1])

        def done(added: list[NumberedScan | None]) -> None:
            if scans is not None:
                scans[2]([scan for scan in added if scan is not None])

        self._write(job, done)

    def events(self, session: str, after: int = 0) -> Iterator[Event]:
        """Yield the events of a session from behind a number."""
        with self._reading() as db:
            yield from journal.events(db, session, after)

    def moves(self, session: str) -> list[Event]:
        """Return the moves of a session to other maps."""
        return self._read(lambda db: journal.moves(db, session))

    def fingerprints(self, session: str, first: int, last: int) -> dict[int, bytes]:
        """Return by which content the steps of a range of sequence numbers are known."""
        return self._read(lambda db: journal.fingerprints(db, session, first, last))

    def step(self, session: str, seq: int) -> Event | None:
        """Return the event of a step."""
        return self._read(lambda db: journal.step(db, session, seq))

    def bindings(self) -> list[Binding]:
        """Return which devices stream into which sessions."""
        return self._read(bindings.bindings)

    def bind(self, binding: Binding) -> None:
        """Let a device stream into a session."""
        self._write(lambda db: bindings.bind(db, binding))

    def snapshots(self, session: str) -> list[Snapshot]:
        """Return the snapshots that are kept, the latest first."""
        return self._read(lambda db: journal.snapshots(db, session))

    def put_snapshot(self, session: str, snapshot: Snapshot) -> None:
        """Keep a snapshot some time soon."""
        self._writer.run_later(lambda db: journal.put_snapshot(db, session, snapshot))

    def artifact(self, digest: str) -> bytes:
        """Return what a session refers to."""
        statement = "SELECT body FROM artifact WHERE digest = ?"
        row = self._read(lambda db: db.execute(statement, (digest,)).fetchone())
        if row is None:
            message = f"artifact {digest} is missing"
            raise StoreError(message)
        return bytes(row[0])

    def api_keys(self) -> list[KeyRecord]:
        """Return all keys by name."""
        rows = self._read(lambda db: db.execute("SELECT * FROM api_key ORDER BY name").fetchall())
        return [
            KeyRecord(
                name,
                hashed,
                tuple(json.loads(scopes)),
                None if sites is None else tuple(json.loads(sites)),
                at,
            )
            for name, hashed, scopes, sites, at in rows
        ]

    def add_key(self, record: KeyRecord) -> None:
        """Keep a key or raise `KeyExistsError`."""
        sites = None if record.sites is None else json.dumps(record.sites)
        scopes = json.dumps(record.scopes)
        row = (record.name, record.hashed, scopes, sites, record.created_at_s)

        def job(db: sqlite3.Connection) -> None:
            statement = "INSERT INTO api_key VALUES (?, ?, ?, ?, ?) ON CONFLICT DO NOTHING"
            if not db.execute(statement, row).rowcount:
                message = f"there is a key {record.name!r} already"
                raise KeyExistsError(message)

        self._write(job)

    def delete_key(self, name: str) -> None:
        """Delete a key or raise `KeyNotFoundError`."""

        def job(db: sqlite3.Connection) -> None:
            if not db.execute("DELETE FROM api_key WHERE name = ?", (name,)).rowcount:
                message = f"there is no key {name!r}"
                raise KeyNotFoundError(message)

        self._write(job)

    def close(self) -> None:
        """Write what waits and release the data directory."""
        self._writer.close()
        self._ownership.close()

    def _write(self, job: Job[Result], done: Callable[[Result], None] = lambda _: None) -> Result:
        return self._writer.run(job, done)

    def _read(self, question: Callable[[sqlite3.Connection], Result]) -> Result:
        with self._reading() as db:
            return question(db)

    @contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        """Give a connection that can neither write nor checkpoint."""
        try:
            with closing(
                sqlite3.connect(self._path, check_same_thread=False, isolation_level=None)
            ) as db:
                db.execute("PRAGMA query_only = ON")
                db.execute("PRAGMA wal_autocheckpoint = 0")
                yield db
        except sqlite3.Error as error:
            message = f"the store does not answer: {error}"
            raise StoreError(message) from error


def _owned(path: Path) -> sqlite3.Connection:
    """Return a connection whose lock says that this process owns the directory."""
    ownership = sqlite3.connect(path, check_same_thread=False, isolation_level=None, timeout=0.0)
    try:
        ownership.execute("BEGIN EXCLUSIVE")
    except sqlite3.OperationalError as error:
        ownership.close()
        if error.sqlite_errorname == "SQLITE_BUSY":
            message = "another process owns it"
            raise OSError(message) from error
        raise
    return ownership


def _done(_cursor: sqlite3.Cursor) -> None:
    """Give nothing back."""
