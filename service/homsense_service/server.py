"""Run the application until a signal comes."""

import ipaddress
import socket
import sys
import threading
from types import FrameType

import uvicorn
from fastapi import FastAPI

from homsense_service import logs
from homsense_service.app import create_app
from homsense_service.bridge import transport
from homsense_service.errors import StoreError
from homsense_service.garbage import settle
from homsense_service.ros2.mapping import read_mapping
from homsense_service.settings import Settings
from homsense_service.store import SqliteStore
from homsense_service.streams import Streams
from homsense_service.warming import Warming

SEND_BUFFER = 256 * 1024
"""Bytes of one connection that wait in the kernel, so that a reader that stands still shows."""


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
    ValueError
        If it is not loopback and there are no keys.
    """
    store = SqliteStore(settings.data)
    try:
        if settings.ros2_mapping is not None:
            read_mapping(settings.ros2_mapping)
        _check_access(settings, has_keys=bool(store.api_keys()))
        listening = socket.create_server((settings.host, settings.port))
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        networks = [transport.opened(settings)] if settings.zenoh_listen else []
    except (OSError, ValueError):
        store.close()
        raise
    host, port = listening.getsockname()[:2]
    devices = f", devices at {', '.join(settings.zenoh_listen)}" if settings.zenoh_listen else ""
    sys.stderr.write(f"homsense serves http://{host}:{port} from {settings.data}{devices}\n")
    logs.configure()
    app = create_app(
        settings,
        lambda _directory: store,
        lambda chosen: networks.pop() if networks else transport.opened(chosen),
    )
    config = uvicorn.Config(
        app,
        log_config=None,
        server_header=False,
        timeout_graceful_shutdown=3,
    )
    _Server(config, app).run(sockets=[listening])


class _Server(uvicorn.Server):
    """Knows of live streams, for whose ends it would wait, and of what stays in memory."""

    def __init__(self, config: uvicorn.Config, app: FastAPI) -> None:
        super().__init__(config)
        self._app = app

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin to serve."""
        await super().startup(sockets)
        threading.Thread(target=self._settle, name="settling", daemon=True).start()

    def _settle(self) -> None:
        warming: Warming = self._app.state.warming
        warming.wait()
        settle()

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Begin to stop."""
        streams: Streams | None = getattr(self._app.state, "streams", None)
        if streams is not None:
            streams.end_all_soon()
        super().handle_exit(sig, frame)


def _check_access(settings: Settings, *, has_keys: bool) -> None:
    """Raise ValueError rather than let anybody in by accident."""
    endpoints = [*settings.zenoh_listen, *settings.zenoh_connect]
    hosts = [settings.host, *map(transport.endpoint_host, endpoints)]
    open_hosts = [host for host in hosts if not _is_loopback(host)]
    if has_keys or settings.open_access or not open_hosts:
        return
    message = (
        f"host: {open_hosts[0]} is not loopback and there are no keys; make one with "
        "`homsense keys add`, or set HOMSENSE_OPEN_ACCESS=true to serve anybody"
    )
    raise ValueError(message)


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def main() -> int:
    """Serve with the settings of the environment; return the exit code."""
    try:
        serve(Settings())
    except (OSError, ValueError, StoreError) as error:
        sys.stderr.write(f"homsense: {error}\n")
        return 2
    return 0
