"""The network that robots share."""

import json
from dataclasses import dataclass
from types import TracebackType
from typing import Self

import zenoh

from homsense_client.errors import ConnectError

LEASE_MS = 4000


@dataclass(frozen=True, slots=True)
class Network:
    """A network that is joined; it is to be closed, or the process does not end.

    Parameters
    ----------
    session : zenoh.Session
        It reconnects by itself; robots of one process can share it.
    prefix : str
        Of the service's keys.
    """

    session: zenoh.Session
    prefix: str = "homsense"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Leave the network."""
        self.session.close()  # type: ignore[no-untyped-call]


def connect(
    *endpoints: str,
    prefix: str = "homsense",
    timeout_s: float = 10.0,
    config: zenoh.Config | None = None,
) -> Network:
    """Join the network of a service or of its routers.

    Parameters
    ----------
    *endpoints : str
        Such as ``tcp/127.0.0.1:7447``; of several, one that is there is used.
    prefix : str, default "homsense"
        Of the service's keys.
    timeout_s : float, default 10.0
        How long to try, seconds; negative for ever.
    config : zenoh.Config, optional
        For TLS or passwords; what is said here goes before.

    Returns
    -------
    Network
        To be closed.

    Raises
    ------
    ConnectError
        If nobody is there.
    """
    chosen = zenoh.Config() if config is None else config
    for path, value in {
        "mode": "client",
        "connect/endpoints": list(endpoints),
        "connect/timeout_ms": round(1000 * timeout_s),
        "connect/retry": {
            "period_init_ms": 200,
            "period_max_ms": 2000,
            "period_increase_factor": 2,
        },
        "scouting/multicast/enabled": False,
        "transport/link/tx/lease": LEASE_MS,
        "transport/shared_memory/enabled": False,
    }.items():
        chosen.insert_json5(path, json.dumps(value))
    try:
        return Network(zenoh.open(chosen), prefix)
    except zenoh.ZError as error:
        reason = str(error).partition(" at /")[0]
        message = f"no zenoh at {', '.join(endpoints)}: {reason}"
        raise ConnectError(message) from error
