"""Run the application until a signal comes."""

import socket
import sys

import uvicorn

from homsense_service.app import create_app
from homsense_service.errors import StoreError
from homsense_service.settings import Settings
from homsense_service.store import SqliteStore


def serve(settings: Settings) -> None:
    """Serve until SIGINT or SIGTERM.

    Parameters
    ----------
    settings : Settings
        Where to listen and where the data is.

    Raises
    ------
    StoreError
        If the data directory cannot be used.
    OSError
        If the address cannot be listened on.
    """
    store = SqliteStore(settings.data)
    try:
        listening = socket.create_server((settings.host, settings.port))
    except OSError:
        store.close()
        raise
    host, port = listening.getsockname()[:2]
    sys.stderr.write(f"homsense serves http://{host}:{port} from {settings.data}\n")
    config = uvicorn.Config(
        create_app(settings, lambda _directory: store),
        log_level="warning",
        timeout_graceful_shutdown=3,
    )
    uvicorn.Server(config).run(sockets=[listening])


def main() -> int:
    """Serve with the settings of the environment; return the exit code."""
    try:
        serve(Settings())
    except (OSError, ValueError, StoreError) as error:
        sys.stderr.write(f"homsense: {error}\n")
        return 2
    return 0
