"""How the service joins a zenoh network."""

import json
from collections.abc import Mapping
from typing import Any

import zenoh

from homsense_service.settings import Settings

LEASE_MS = 4000
STALL_US = 200_000
MAX_SESSIONS = 10_000
RETRY = {"period_init_ms": 200, "period_max_ms": 2000, "period_increase_factor": 2}
CONNECT_MS = 2000


def is_wanted(settings: Settings) -> bool:
    """Tell whether the service is to join a network at all."""
    return bool(settings.zenoh_listen or settings.zenoh_connect)


def opened(settings: Settings) -> zenoh.Session:
    """Return a session on the network.

    Parameters
    ----------
    settings : Settings
        A service that listens is a peer, which relays for its devices; one that does not is a
        client of routers.

    Returns
    -------
    zenoh.Session
        To be closed: the process does not end before.

    Raises
    ------
    ConnectionError
        If no router answers, or an endpoint cannot be listened on.
    ValueError
        If the configuration file is none.
    """
    try:
        return zenoh.open(configured(settings))
    except zenoh.ZError as error:
        where = ", ".join([*settings.zenoh_listen, *settings.zenoh_connect])
        message = f"zenoh at {where}: {said(error)}"
        raise ConnectionError(message) from error


def configured(settings: Settings) -> zenoh.Config:
    """Return the configuration of zenoh: the operator's file, and over it what settings say."""
    path = settings.zenoh_config
    try:
        config = zenoh.Config() if path is None else zenoh.Config.from_file(str(path))
    except zenoh.ZError as error:
        message = f"zenoh_config: {path} cannot be used: {said(error)}"
        raise ValueError(message) from error
    chosen: dict[str, Any] = {
        "mode": "peer" if settings.zenoh_listen else "client",
        "listen/endpoints": settings.zenoh_listen,
        "connect/endpoints": settings.zenoh_connect,
        "connect/retry": RETRY,
        "connect/timeout_ms": CONNECT_MS,
        "scouting/multicast/enabled": False,
        "transport/link/tx/lease": LEASE_MS,
        "transport/link/tx/queue/congestion_control/block/wait_before_close": STALL_US,
        "transport/link/rx/max_message_size": 4 * settings.zenoh_max_bytes,
        "transport/unicast/max_sessions": MAX_SESSIONS,
        "transport/shared_memory/enabled": False,
    }
    return with_values(config, chosen)


def with_values(config: zenoh.Config, values: Mapping[str, Any]) -> zenoh.Config:
    """Return a configuration with some values set, by their paths."""
    for path, value in values.items():
        config.insert_json5(path, json.dumps(value))
    return config


def said(error: zenoh.ZError) -> str:
    """Return what went wrong, without the place in zenoh's source."""
    return str(error).partition(" at /")[0]


def endpoint_host(endpoint: str) -> str:
    """Return the host of an endpoint.

    Examples
    --------
    >>> endpoint_host("tcp/127.0.0.1:7447"), endpoint_host("tls/[::1]:7447#iface=lo")
    ('127.0.0.1', '::1')
    """
    address = endpoint.partition("/")[2].partition("#")[0].partition("?")[0]
    return address.rpartition(":")[0].strip("[]")
