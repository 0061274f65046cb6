"""Work on a data directory whose service is stopped."""

import time
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

from homsense_service.keys import new_key
from homsense_service.schemas import KeyIn
from homsense_service.store import SqliteStore
from rich.console import Console
from rich.table import Table


def add_key(data: Path, name: str, scopes: list[str], sites: list[str] | None) -> str:
    """Make a key and return it.

    Parameters
    ----------
    data : pathlib.Path
        Directory of the store.
    name : str
        For people.
    scopes : list of str
        What it is good for.
    sites : list of str, optional
        Where; everywhere when absent.

    Returns
    -------
    str
        The key, which is told only now.

    Raises
    ------
    ValueError
        If a name or a scope is not good.
    ServiceError
        If there is such a key, or the store cannot be used.
    """
    KeyIn.model_validate({"name": name, "scopes": scopes, "sites": sites or None})
    token, record = new_key(name, scopes, sites, time.time())
    with closing(SqliteStore(data)) as store:
        store.add_key(record)
    return token


def list_keys(data: Path, console: Console) -> None:
    """Print the keys of a store."""
    table = Table("name", "scopes", "sites", "made")
    with closing(SqliteStore(data)) as store:
        for record in store.api_keys():
            made = datetime.fromtimestamp(record.created_at_s, UTC)
            sites = "all" if record.sites is None else ", ".join(record.sites)
            table.add_row(record.name, ", ".join(record.scopes), sites, f"{made:%Y-%m-%d %H:%M}")
    console.print(table)


def remove_key(data: Path, name: str) -> None:
    """Remove a key, or raise `KeyNotFoundError`."""
    with closing(SqliteStore(data)) as store:
        store.delete_key(name)
