"""Highest-density regions as polygons are the cells that they are made of, and nothing else."""

import numpy as np
import shapely
from homsense_service.rendering_poses import render_geojson
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage
from support.builders import SQUARE_MAP

import homsense

SITE = homsense.SiteMap.from_geojson(SQUARE_MAP)
places = st.tuples(st.floats(-40.0, 40.0), st.floats(-40.0, 40.0))


@given(
    at=st.lists(places, min_size=1, max_size=12),
    cell_m=st.sampled_from([0.7, 3.3, 4.0, 5.0]),
)
def test_a_region_has_the_area_of_its_cells_and_no_cracks(
    at: list[tuple[float, float]], cell_m: float
) -> None:
    poses = np.array([(x_m, y_m, 0.0) for x_m, y_m in at])
    pose = homsense.PoseDistribution.of(poses, np.ones(len(at)), cell_m)
    document = render_geojson(pose, SITE)
    for region in document["features"][-3:]:
        found = shapely.geometry.shape(region["geometry"])
        level = region["properties"]["level"]
        inside = pose.region(level)
        assert found.is_valid
        assert abs(found.area - pose.region_area_m2(level)) < 1e-6 * found.area
        assert shapely.get_num_geometries(found) == ndimage.label(inside)[1]
