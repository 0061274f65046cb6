"""zenoh networks on loopback, and services on them."""

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
import zenoh
from homsense_cli.local_service import free_port

from support.builders import SITE_MAP

RING = [["a", "b"], ["b", "c"], ["c", "d"], ["d", "a"]]
COUNTING = {"type": "homology"}


def endpoint() -> str:
    """Return an endpoint that nobody listens on."""
    return f"tcp/127.0.0.1:{free_port()}"


@contextmanager
def router(*listen: str, connect: tuple[str, ...] = (), **options: Any) -> Iterator[zenoh.Session]:
    """Run a router in this process; options have `__` for `/`."""
    config = zenoh.Config()
    chosen = {
        "mode": "router",
        "listen/endpoints": list(listen),
        "connect/endpoints": list(connect),
        "scouting/multicast/enabled": False,
        **{name.replace("__", "/"): value for name, value in options.items()},
    }
    for path, value in chosen.items():
        config.insert_json5(path, json.dumps(value))
    with zenoh.open(config) as session:
        yield session


def fill(api: Any, site: str = "yard") -> None:
    """Give a service, by an HTTP client, a site with a map and scans round a block."""
    api.put(f"/v1/sites/{site}", json={"s_max_m": 20.0, "hops": [1, 2]}).raise_for_status()
    api.put(f"/v1/sites/{site}/map", json=SITE_MAP).raise_for_status()
    scans = [
        {"device": "phone", "scan_id": str(n), "observed_at": 1.7e9 + n, "landmarks": seen}
        for n, seen in enumerate(RING)
    ]
    api.post(f"/v1/sites/{site}/scans", json={"scans": scans}).raise_for_status()


def until(holds: Callable[[], Any], timeout_s: float = 10.0, every_s: float = 0.01) -> Any:
    """Wait until something holds and return it; fail when it never does."""
    ends_s = time.monotonic() + timeout_s
    while time.monotonic() < ends_s:
        found = holds()
        if found:
            return found
        time.sleep(every_s)
    pytest.fail(f"still not so after {timeout_s} s")
