"""The metric map: what is a structure, what is free, what is refused."""

import math
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from support.builders import SQUARE_MAP, feature, local_map, square

from homsense import FreeSpace, InvalidInputError, InvalidMapError, SiteMap


def test_touching_polygons_are_one_structure() -> None:
    site_map = SiteMap.from_geojson(
        local_map(feature(square(0, 0, 10)), feature(square(10, 0, 10)), feature(square(40, 0, 5)))
    )
    assert len(site_map.structures) == 2
    assert sum(s.area for s in site_map.structures) == pytest.approx(225.0, abs=0.5)


def test_a_courtyard_is_kept_but_nobody_gets_there() -> None:
    block = square(0, 0, 30)
    block["coordinates"].append(square(10, 10, 10)["coordinates"][0])
    site_map = SiteMap.from_geojson(local_map(feature(block)))
    assert len(site_map.structures) == 1
    assert [round(court.area) for court in site_map.courtyards] == [100]
    assert site_map.is_free(np.array([[15.0, 15.0], [-5.0, 5.0]])).tolist() == [False, True]


def test_a_building_in_a_courtyard_belongs_to_the_structure_around_it() -> None:
    block = square(0, 0, 30)
    block["coordinates"].append(square(5, 5, 20)["coordinates"][0])
    site_map = SiteMap.from_geojson(local_map(feature(block), feature(square(12, 12, 4))))
    assert len(site_map.structures) == 1


def test_the_domain_limits_free_space() -> None:
    document = local_map(feature(square(0, 0, 10)), feature(square(-5, -5, 20), role="domain"))
    site_map = SiteMap.from_geojson(document)
    assert site_map.bounds == (-5.0, -5.0, 15.0, 15.0)
    assert site_map.free_space.area == pytest.approx(300.0)
    assert site_map.is_free(np.array([[-4.0, 0.0], [-6.0, 0.0]])).tolist() == [True, False]


def test_degrees_become_metres_and_back() -> None:
    lon, lat, step = 24.94, 60.17, 0.001
    ring = [[lon, lat], [lon + step, lat], [lon + step, lat + step], [lon, lat + step], [lon, lat]]
    site_map = SiteMap.from_geojson({"type": "Polygon", "coordinates": [ring]})
    west, south, east, north = site_map.structures[0].bounds
    assert east - west == pytest.approx(55.5, abs=0.5)
    assert north - south == pytest.approx(111.4, abs=0.5)
    assert site_map.to_wgs84(np.array([[west, south]]))[0] == pytest.approx([lon, lat], abs=1e-5)
    assert SiteMap.from_geojson(SQUARE_MAP).origin is None
    with pytest.raises(InvalidMapError, match="georeference"):
        SiteMap.from_geojson(SQUARE_MAP).to_wgs84(np.zeros((1, 2)))


def test_the_digest_follows_the_content_and_not_its_order() -> None:
    one = local_map(feature(square(0, 0, 10)), feature(square(40, 0, 5)))
    other = local_map(*reversed(one["features"]))
    assert SiteMap.from_geojson(one).digest() == SiteMap.from_geojson(other).digest()
    moved = local_map(feature(square(0, 0, 10)), feature(square(41, 0, 5)))
    assert SiteMap.from_geojson(one).digest() != SiteMap.from_geojson(moved).digest()


def test_the_surface_mesh_holds_corners_and_keeps_its_spacing() -> None:
    (mesh,) = SiteMap.from_geojson(SQUARE_MAP).surface_mesh(3.0)
    gaps = np.linalg.norm(np.diff(np.vstack([mesh, mesh[:1]]), axis=0), axis=1)
    assert gaps.max() <= 3.0
    assert {(0.0, 0.0), (10.0, 10.0)} <= {tuple(np.round(point, 6)) for point in mesh}


def _with(geometry: Any) -> dict[str, Any]:
    return local_map(feature(square(40, 40, 5)), feature(geometry))


BAD_RING = [[0, 0], [math.nan, 0], [1, 1], [0, 0]]
BOW_TIE = [[0, 0], [10, 10], [10, 0], [0, 10], [0, 0]]
LINE = [[0, 0], [5, 0], [10, 0], [0, 0]]


@pytest.mark.parametrize(
    ("document", "field"),
    [
        ([], None),
        ({}, "type"),
        ({"type": "FeatureCollection", "features": []}, "features"),
        ({"type": "FeatureCollection", "features": "x"}, "features"),
        ({"type": "FeatureCollection", "features": [3]}, "features.0"),
        ({**SQUARE_MAP, "frame": "mars"}, "frame"),
        (_with({"type": "Point", "coordinates": [0, 0]}), "features.1.geometry.type"),
        (_with(None), "features.1.geometry"),
        (_with({"type": "Polygon"}), "features.1.geometry.coordinates"),
        (_with({"type": "Polygon", "coordinates": []}), "features.1.geometry.coordinates"),
        (
            _with({"type": "Polygon", "coordinates": [BAD_RING]}),
            "features.1.geometry.coordinates.0",
        ),
        (
            _with({"type": "Polygon", "coordinates": [[["a", "b"]]]}),
            "features.1.geometry.coordinates.0",
        ),
        (
            _with({"type": "Polygon", "coordinates": [[[0, 0], [1, 1]]]}),
            "features.1.geometry.coordinates.0",
        ),
        (_with({"type": "Polygon", "coordinates": [BOW_TIE]}), "features.1.geometry.coordinates"),
        (_with({"type": "Polygon", "coordinates": [LINE]}), "features.1.geometry.coordinates"),
        (_with({"type": "MultiPolygon", "coordinates": [3]}), "features.1.geometry.coordinates.0"),
        (local_map(feature(square(0, 0, 5), role="roof")), "features.0.properties.role"),
        (local_map(feature(square(0, 0, 5), role="domain")), "features"),
        (
            local_map(feature(square(0, 0, 50)), feature(square(5, 5, 9), role="domain")),
            "features",
        ),
        (local_map(feature(square(0, 0, 5)), feature(square(3e5, 0, 5))), "features"),
        ({"type": "Polygon", "coordinates": square(0, 0, 500)["coordinates"]}, "geometry"),
    ],
)
def test_a_bad_map_is_refused_by_name(document: Any, field: str | None) -> None:
    with pytest.raises(InvalidMapError) as caught:
        SiteMap.from_geojson(document)
    assert caught.value.field == field


def test_all_kinds_of_containers_are_read() -> None:
    geometry = square(0, 0, 5)
    multi = {"type": "MultiPolygon", "coordinates": [geometry["coordinates"]]}
    bag = {"type": "GeometryCollection", "geometries": [geometry, multi], "frame": "local"}
    assert len(SiteMap.from_geojson(bag).structures) == 1
    single = {**feature(geometry), "frame": "local"}
    assert len(SiteMap.from_geojson(single).structures) == 1


def test_free_space_needs_a_cell(square: SiteMap) -> None:
    with pytest.raises(InvalidMapError, match="cell"):
        FreeSpace.of(square, 40.0)
    for cell_m in (0.0, -1.0, math.nan, 0.001):
        with pytest.raises(InvalidInputError, match="cell_m"):
            FreeSpace.of(square, cell_m)


RACE = """
import threading
import numpy as np
from homsense_fleet.world import downtown_44
import homsense

document = downtown_44(0).map_document()
xy = np.stack(np.meshgrid(np.linspace(0, 600, 20), np.linspace(0, 600, 20)), -1).reshape(-1, 2)
for _ in range(150):
    site_map, start = homsense.SiteMap.from_geojson(document), threading.Barrier(8)
    threads = [
        threading.Thread(target=lambda: (start.wait(), site_map.is_free(xy))) for _ in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
"""


def test_threads_can_ask_one_map_at_once() -> None:
    subprocess.run([sys.executable, "-c", RACE], check=True)
