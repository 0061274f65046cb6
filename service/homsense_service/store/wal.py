"""The end of SQLite's write-ahead log: whether it breaks off within a transaction."""

import sqlite3
import struct
from pathlib import Path

_HEADER, _FRAME = 32, 24
_PAGE_SIZE, _SALTS, _FRAME_SALTS = struct.Struct(">I"), struct.Struct(">8s"), struct.Struct(">8s")


def has_ragged_end(connection: sqlite3.Connection, database: Path) -> bool:
    """Tell whether frames follow behind the last transaction that SQLite believes.

    Parameters
    ----------
    connection : sqlite3.Connection
        Just opened; it has found out how far the log can be believed.
    database : pathlib.Path
        The file; the log lies beside it.

    Returns
    -------
    bool
        True after a crash in the middle of a write, or when the end of the log was damaged.
    """
    try:
        log = Path(f"{database}-wal").open("rb")  # noqa: SIM115 - closed below
    except FileNotFoundError:
        return False
    with log:
        header = log.read(_HEADER)
        if len(header) < _HEADER:
            return False
        (page_size,) = _PAGE_SIZE.unpack_from(header, 8)
        _, believed, _ = connection.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchone()
        log.seek(_HEADER + believed * (_FRAME + page_size))
        frame = log.read(_FRAME)
    return len(frame) == _FRAME and (
        _FRAME_SALTS.unpack_from(frame, 8) == _SALTS.unpack_from(header, 16)
    )
