"""Settings for all tests."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from homsense_service.app import create_app
from homsense_service.settings import Settings
from hypothesis import HealthCheck, settings
from support.builders import SITE_MAP, SQUARE_MAP

import homsense

settings.register_profile(
    "default", deadline=None, suppress_health_check=[HealthCheck.too_slow], derandomize=True
)
settings.register_profile("thorough", parent=settings.get_profile("default"), max_examples=2000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "default"))


@pytest.fixture
def square() -> homsense.SiteMap:
    """A map with one square structure of 10 m."""
    return homsense.SiteMap.from_geojson(SQUARE_MAP)


@pytest.fixture
def api(tmp_path: Path) -> Iterator[TestClient]:
    """A service of its own, in process."""
    with TestClient(
        create_app(Settings(data=tmp_path / "data")), base_url="http://test"
    ) as client:
        yield client


@pytest.fixture
def site(api: TestClient) -> str:
    """A site with a map and a few scans round a block."""
    api.put("/v1/sites/yard", json={"s_max_m": 20.0, "hops": [1, 2]}).raise_for_status()
    api.put("/v1/sites/yard/map", json=SITE_MAP).raise_for_status()
    ring = [["a", "b"], ["b", "c"], ["c", "d"], ["d", "a"]]
    scans = [
        {"device": "phone", "scan_id": str(n), "observed_at": 1.7e9 + n, "landmarks": seen}
        for n, seen in enumerate(ring)
    ]
    api.post("/v1/sites/yard/scans", json={"scans": scans}).raise_for_status()
    return "yard"


@pytest.fixture
def recordings() -> Path:
    """The folder of recorded data beside the project."""
    found = os.environ.get("HOMSENSE_RECORDINGS")
    directory = Path(found) if found else Path(__file__).parents[2] / "shared" / "data"
    if not directory.is_dir():
        pytest.skip("no recorded data: set HOMSENSE_RECORDINGS to its folder (docs/data.md)")
    return directory
