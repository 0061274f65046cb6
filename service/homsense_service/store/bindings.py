"""Which session each device streams into."""

import sqlite3

from homsense_service.records import Binding
from homsense_service.store.journal import session_number


def bindings(connection: sqlite3.Connection) -> list[Binding]:
    """Return all bindings."""
    rows = connection.execute(
        "SELECT b.device, s.name, b.nonce, b.token, b.key, b.pose_hz "
        "FROM binding b JOIN session s ON s.number = b.session"
    )
    return [Binding(*row) for row in rows]


def bind(connection: sqlite3.Connection, binding: Binding) -> None:
    """Bind a device to a session, each to no other."""
    session = session_number(connection, binding.session)
    connection.execute(
        "INSERT OR REPLACE INTO binding VALUES (?, ?, ?, ?, ?, ?)",
        (
            binding.device,
            session,
            binding.nonce,
            binding.token,
            binding.key,
            binding.pose_hz,
        ),
    )
