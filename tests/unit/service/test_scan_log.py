"""Some scans of a log, chosen by the store."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from homsense_service.app import create_app
from homsense_service.settings import Settings
from homsense_service.store import SqliteStore

DIGITS = "0123456789"


@pytest.fixture
def filled(tmp_path: Path) -> Iterator[tuple[TestClient, SqliteStore]]:
    """A service, and its store with ten scans of either of two sites, in turns."""
    stores: list[SqliteStore] = []

    def open_store(directory: Path) -> SqliteStore:
        stores.append(SqliteStore(directory))
        return stores[-1]

    with TestClient(create_app(Settings(data=tmp_path, check_scans=4), open_store)) as api:
        for digit in DIGITS:
            for site in "ab":
                heard = [{"id": f"l{digit}", "rssi": -60}, {"id": "all", "rssi": -50}]
                scan = {"device": "d", "scan_id": digit, "observed_at": 1.7e9, "landmarks": heard}
                api.put(f"/v1/sites/{site}", json={"landmark_key": "ssid"})
                taken = api.post(f"/v1/sites/{site}/scans", json={"scans": [scan]}).json()
                assert taken["accepted"] == 1
        yield api, stores[0]


@pytest.mark.parametrize(
    ("most", "even"),
    [(1, "0"), (2, "05"), (3, "048"), (4, "0369"), (9, "02468"), (10, DIGITS), (99, DIGITS)],
)
def test_scans_are_chosen_evenly_over_the_log_of_a_site(
    filled: tuple[TestClient, SqliteStore], most: int, even: str
) -> None:
    _, store = filled
    for site in "ab":
        chosen = store.even_scans(site, most)
        assert "".join(scan.scan_id for scan in chosen) == even
        assert all(scan.readings[1].landmark == "all" for scan in chosen)
        latest = store.latest_scans(site, most)
        assert "".join(scan.scan_id for scan in latest) == DIGITS[-most:]


def test_self_checks_say_how_many_scans_they_looked_at(
    filled: tuple[TestClient, SqliteStore],
) -> None:
    api, _ = filled
    path = "/v1/sites/b/complex?curve"
    ranges, witnesses = (api.get(f"{path}={of}").json() for of in ("rssi", "witnesses"))
    assert (ranges["scans"], ranges["points"][-1]["facets"]) == (4, 4)
    assert (witnesses["scans"], witnesses["points"][0]["facets"]) == (4, 4)
