"""Work on a data directory whose service is stopped."""

import time
from collections.abc import Iterator
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

from homsense_service.errors import SiteNotFoundError
from homsense_service.keys import new_key
from homsense_service.operations import Operations
from homsense_service.portable import check, exported, imported
from homsense_service.schemas import KeyIn
from homsense_service.settings import Settings
from homsense_service.sites import SiteRegistry
from homsense_service.store import SqliteStore
from homsense_service.verifying import verified
from rich.console import Console
from rich.table import Table

from homsense.engine import fastest

_PIECE = 2**16


def export_site(data: Path, site: str, out: Path) -> None:
    """Write a site to a file; nothing is left of it when that fails.

    Parameters
    ----------
    data : pathlib.Path
        Directory of the store.
    site : str
        Name of the site.
    out : pathlib.Path
        The file.

    Raises
    ------
    ServiceError
        If there is no such site, or the store cannot be used.
    """
    with closing(SqliteStore(data)) as store:
        if site not in store.sites():
            raise SiteNotFoundError(site)
        partial = out.with_name(f"{out.name}.partial")
        with partial.open("wb") as file:
            file.writelines(exported(store, site))
        partial.replace(out)


def import_site(data: Path, file: Path, name: str | None) -> tuple[str, int]:
    """Make a site from a file; return its name and how many scans it has.

    Parameters
    ----------
    data : pathlib.Path
        Directory of the store.
    file : pathlib.Path
        From `export_site`.
    name : str, optional
        Of the site; as in the file when absent.

    Returns
    -------
    name : str
        Of the site.
    scans : int
        How many it has.

    Raises
    ------
    ServiceError
        If the file is not sound, there is such a site, or the store cannot be used.
    """
    found = check(_pieces(file))
    chosen = name or found
    with closing(SqliteStore(data)) as store:
        return chosen, imported(store, _pieces(file), chosen)


def verify(data: Path, console: Console) -> bool:
    """Build all of a store again from its logs, print what was found, tell whether all is sound.

    Parameters
    ----------
    data : pathlib.Path
        Directory of the store.
    console : rich.console.Console
        Where to.

    Returns
    -------
    bool
        Whether nothing differs.
    """
    table, sound = Table("what", "sound", "found"), True
    settings = Settings(data=data)
    with closing(SqliteStore(data)) as store:
        sites = SiteRegistry(store, settings, fastest, time.time)
        with closing(sites):
            operations = Operations(sites, store, settings, time.time)
            for found in verified(store, operations):
                sound = sound and found.is_sound
                table.add_row(found.what, "yes" if found.is_sound else "NO", found.told)
    console.print(table)
    return sound


def _pieces(file: Path) -> Iterator[bytes]:
    with file.open("rb") as opened:
        while piece := opened.read(_PIECE):
            yield piece


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
