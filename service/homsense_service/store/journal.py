"""Sessions in SQL: what they were opened as, their events, snapshots and artifacts."""

import json
import sqlite3
from collections.abc import Iterator, Sequence

from homsense_service.errors import SessionNotFoundError
from homsense_service.records import Event, SessionRecord, Snapshot
from homsense_service.store.contract import Artifacts
from homsense_service.store.scan_log import site_number

SNAPSHOTS_KEPT = 2


def session_number(connection: sqlite3.Connection, session: str) -> int:
    """Return the number of a session or raise `SessionNotFoundError`."""
    row = connection.execute("SELECT number FROM session WHERE name = ?", (session,)).fetchone()
    if row is None:
        raise SessionNotFoundError(session)
    return int(row[0])


def sessions(connection: sqlite3.Connection) -> list[SessionRecord]:
    """Return all sessions in the order in which they were opened."""
    rows = connection.execute(
        "SELECT e.name, s.name, e.opened_at, e.document FROM session e "
        "JOIN site s ON s.number = e.site ORDER BY e.number"
    )
    return [SessionRecord(name, site, at, json.loads(text)) for name, site, at, text in rows]


def open_session(
    connection: sqlite3.Connection, record: SessionRecord, artifacts: Artifacts
) -> None:
    """Keep a session."""
    inserted = connection.execute(
        "INSERT INTO session (name, site, opened_at, document) VALUES (?, ?, ?, ?)",
        (
            record.name,
            site_number(connection, record.site),
            record.opened_at_s,
            json.dumps(record.document),
        ),
    )
    _refer(connection, inserted.lastrowid or 0, artifacts)


def close_session(connection: sqlite3.Connection, session: str) -> None:
    """Delete a session with all that belongs to it alone."""
    number = session_number(connection, session)
    connection.execute("DELETE FROM session WHERE number = ?", (number,))
    drop_unused_artifacts(connection)


def drop_unused_artifacts(connection: sqlite3.Connection) -> None:
    """Delete the artifacts that no session refers to."""
    connection.execute(
        "DELETE FROM artifact WHERE digest NOT IN (SELECT digest FROM artifact_of_session)"
    )


def append(
    connection: sqlite3.Connection,
    session: str,
    added: Sequence[Event],
    artifacts: Artifacts | None = None,
) -> None:
    """Append events to a session."""
    number = session_number(connection, session)
    connection.executemany(
        "INSERT INTO event VALUES (?, ?, ?, ?, ?)",
        [(number, e.number, e.seq, e.fingerprint, e.body) for e in added],
    )
    if artifacts:
        _refer(connection, number, artifacts)


def events(connection: sqlite3.Connection, session: str, after: int) -> Iterator[Event]:
    """Yield the events of a session."""
    rows = connection.execute(
        "SELECT number, seq, fingerprint, body FROM event "
        "WHERE session = ? AND number > ? ORDER BY number",
        (session_number(connection, session), after),
    )
    for row in rows:
        yield Event(*row)


def moves(connection: sqlite3.Connection, session: str) -> list[Event]:
    """Return the moves of a session to other maps."""
    rows = connection.execute(
        "SELECT number, seq, fingerprint, body FROM event "
        "WHERE session = ? AND fingerprint = x'' ORDER BY number",
        (session_number(connection, session),),
    )
    return [Event(*row) for row in rows]


def fingerprints(
    connection: sqlite3.Connection, session: str, first: int, last: int
) -> dict[int, bytes]:
    """Return the fingerprints of some steps."""
    return dict(
        connection.execute(
            "SELECT seq, fingerprint FROM event "
            "WHERE session = ? AND seq BETWEEN ? AND ? AND fingerprint != x''",
            (session_number(connection, session), first, last),
        )
    )


def step(connection: sqlite3.Connection, session: str, seq: int) -> Event | None:
    """Return the event of a step."""
    row = connection.execute(
        "SELECT number, seq, fingerprint, body FROM event "
        "WHERE session = ? AND seq = ? AND fingerprint != x''",
        (session_number(connection, session), seq),
    ).fetchone()
    return None if row is None else Event(*row)


def snapshots(connection: sqlite3.Connection, session: str) -> list[Snapshot]:
    """Return the snapshots of a session, the latest first."""
    rows = connection.execute(
        "SELECT number, body FROM snapshot WHERE session = ? ORDER BY number DESC",
        (session_number(connection, session),),
    )
    return [Snapshot(*row) for row in rows]


def put_snapshot(connection: sqlite3.Connection, session: str, snapshot: Snapshot) -> None:
    """Keep a snapshot, unless the session was closed; forget all but the latest ones."""
    try:
        number = session_number(connection, session)
    except SessionNotFoundError:
        return
    connection.execute(
        "INSERT OR REPLACE INTO snapshot VALUES (?, ?, ?)",
        (number, snapshot.number, snapshot.body),
    )
    connection.execute(
        "DELETE FROM snapshot WHERE session = ?1 AND number NOT IN "
        "(SELECT number FROM snapshot WHERE session = ?1 ORDER BY number DESC LIMIT ?2)",
        (number, SNAPSHOTS_KEPT),
    )


def _refer(connection: sqlite3.Connection, session: int, artifacts: Artifacts) -> None:
    for digest, to_bytes in artifacts.items():
        known = connection.execute("SELECT 1 FROM artifact WHERE digest = ?", (digest,))
        if known.fetchone() is None:
            connection.execute("INSERT INTO artifact VALUES (?, ?)", (digest, to_bytes()))
    connection.executemany(
        "INSERT OR IGNORE INTO artifact_of_session VALUES (?, ?)",
        [(session, digest) for digest in artifacts],
    )
