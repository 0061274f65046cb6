"""``homsense zenoh router``: a router, where there is no ``zenohd``."""

import signal
import sys
from pathlib import Path

import zenoh
from homsense_service.bridge.transport import said, with_values


def run_router(listen: list[str], connect: list[str], config: Path | None) -> None:
    """Route until SIGINT or SIGTERM.

    Parameters
    ----------
    listen : list of str
        Endpoints.
    connect : list of str
        Of other routers.
    config : pathlib.Path, optional
        For TLS, passwords and access control.

    Raises
    ------
    ValueError
        If an endpoint or the file cannot be used.
    """
    signals = {signal.SIGINT, signal.SIGTERM}
    signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    try:
        chosen = zenoh.Config() if config is None else zenoh.Config.from_file(str(config))
        routing = {
            "mode": "router",
            "listen/endpoints": listen,
            "connect/endpoints": connect,
            "scouting/multicast/enabled": False,
        }
        with zenoh.open(with_values(chosen, routing)):
            sys.stderr.write(f"homsense routes at {', '.join(listen)}\n")
            signal.sigwait(signals)
    except zenoh.ZError as error:
        message = f"zenoh: {said(error)}"
        raise ValueError(message) from error
