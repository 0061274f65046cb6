"""A service of our own for the length of a command."""

import os
import secrets
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import httpx

START_S = 30.0
_PORTS = range(20_000, 32_000)


@contextmanager
def local_service(**settings: object) -> Iterator[str]:
    """Run a service on loopback with an empty store, and stop it at the end.

    Parameters
    ----------
    **settings : object
        Settings of the service, as in ``cell_m=1.0``.

    Yields
    ------
    str
        Its base URL.

    Raises
    ------
    RuntimeError
        If it does not start.
    """
    with (
        tempfile.TemporaryDirectory(prefix="homsense-") as directory,
        start(Path(directory), **settings) as url,
    ):
        yield url


@contextmanager
def start(data: Path, **settings: object) -> Iterator[str]:
    """Run a service on loopback, and stop it at the end.

    Parameters
    ----------
    data : pathlib.Path
        Directory of its store.
    **settings : object
        Settings of the service, as in ``cell_m=1.0``.

    Yields
    ------
    str
        Its base URL.

    Raises
    ------
    RuntimeError
        If it does not start.
    """
    port = free_port()
    given = {"DATA": data, "PORT": port, **{k.upper(): v for k, v in settings.items()}}
    environment = {f"HOMSENSE_{name}": str(value) for name, value in given.items()}
    command = [sys.executable, "-m", "homsense_service"]
    process = subprocess.Popen(command, env={**os.environ, **environment})
    try:
        url = f"http://127.0.0.1:{port}"
        _await_health(url, process)
        yield url
    finally:
        process.terminate()
        try:
            process.wait(timeout=10.0)
        except subprocess.TimeoutExpired:
            process.kill()


def free_port() -> int:
    """Return a port that nobody listens on and that outgoing connections are not given."""
    while True:
        port = secrets.choice(_PORTS)
        with socket.socket() as probe, suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port


def _await_health(url: str, process: "subprocess.Popen[bytes]") -> None:
    deadline = time.monotonic() + START_S
    while time.monotonic() < deadline and process.poll() is None:
        try:
            if httpx.get(f"{url}/healthz").is_success:
                return
        except httpx.TransportError:
            time.sleep(0.05)
    message = "the service did not start"
    raise RuntimeError(message)
