"""Radii without ground truth: match what the map expects with what the sensor counts."""

from collections.abc import Sequence

import numpy as np

from homsense.earth_mover import earth_mover_distance
from homsense.errors import InvalidInputError
from homsense.free_space import FreeSpace
from homsense.height import MESH_M, structures_within
from homsense.philox import Purpose, random_words
from homsense.site_map import SiteMap

_RADII = 200
_PLACES = 2000


def calibrate_r_geo(
    site_map: SiteMap, free_space: FreeSpace, counts: Sequence[int], *, seed: int = 0
) -> float:
    """Choose r_geo so that expected counts over free space are distributed as measured ones.

    Parameters
    ----------
    site_map : SiteMap
        The map.
    free_space : FreeSpace
        Its free cells.
    counts : sequence of int
        Holes sensed for a sample of the site's scans; where they were taken is not needed.
    seed : int, default 0
        Decides the places that represent free space.

    Returns
    -------
    float
        Geodetic radius, metres: the one with the least 1-Wasserstein distance between the two
        distributions.

    Raises
    ------
    InvalidInputError
        If there is no count.
    """
    if not counts:
        message = "r_geo cannot be calibrated without counts"
        raise InvalidInputError(message, "counts")
    words = random_words(seed, 0, Purpose.PRIOR, _PLACES)
    places = np.stack(free_space.draw(words[:3]), axis=1, dtype=np.float64)
    west, south, east, north = site_map.bounds
    radii = np.linspace(0.0, float(np.hypot(east - west, north - south)), _RADII + 1)[1:]
    expected = structures_within(site_map.surface_mesh(MESH_M), places, radii)
    apart = [earth_mover_distance(row, counts) for row in expected]
    return float(radii[int(np.argmin(apart))])
