"""What a session localizes with: built when it is opened, and the same again after a restart."""

from collections.abc import Mapping
from typing import Any

import homsense
from homsense.backend import Backend
from homsense_service import schemas
from homsense_service.archive import (
    Archive,
    Artifacts,
    map_bytes,
    map_of,
    sensor_document,
    sensor_of,
)
from homsense_service.runs import Run
from homsense_service.sensors import Sensor
from homsense_service.site import Site
from homsense_service.versions import MapVersion


def localizing(
    site: Site,
    version: MapVersion,
    wall_tolerance_m: float,
    sensor: Sensor,
    request: schemas.SessionIn,
    backend: Backend,
) -> Run:
    """Return what a session localizes with.

    Parameters
    ----------
    site : Site
        Where.
    version : MapVersion
        The map.
    wall_tolerance_m : float
        How far behind its walls a device may be, metres.
    sensor : Sensor
        How it measures.
    request : SessionIn
        What was asked for.
    backend : Backend
        What runs the filter now; a run is the same with any.

    Returns
    -------
    Run
        The same for the same arguments, to the last bit.
    """
    reachable = site.reachable(version, wall_tolerance_m)
    config = request.to_localizer_config(version.free_space.grid.cell_m, sensor)
    localizer = homsense.Localizer(
        version.site_map,
        (),
        config,
        free_space=reachable,
        likelihood=site.likelihood(reachable, sensor, config.noise),
        backend=backend,
    )
    return Run(version, wall_tolerance_m, sensor, localizer)


def run_document(run: Run, archive: Archive) -> tuple[dict[str, Any], Artifacts]:
    """Return what a run can be made again from, and the artifacts that this refers to."""
    artifacts: Artifacts = {}
    version = run.map_version
    document = {
        "map": archive.keep(version, lambda: map_bytes(version), artifacts),
        "wall_tolerance_m": run.wall_tolerance_m,
        "sensor": sensor_document(run.sensor, archive, artifacts),
    }
    return document, artifacts


def restored(
    document: Mapping[str, Any],
    site: Site,
    request: schemas.SessionIn,
    archive: Archive,
    backend: Backend,
) -> Run:
    """Return the run that a document tells of."""
    version = archive.get(document["map"], map_of)
    tolerance_m = document["wall_tolerance_m"]
    reachable = site.reachable(version, tolerance_m)
    sensor = sensor_of(document["sensor"], archive, version, reachable)
    return localizing(site, version, tolerance_m, sensor, request, backend)
