"""Values -> wire: poses, sessions and distributions."""

import base64
import math
from typing import Any

import numpy as np
import shapely
from shapely.geometry import mapping
from shapely.geometry.base import BaseGeometry

import homsense
from homsense.registered.complex import EVEN_ODDS
from homsense_service import schemas
from homsense_service.runs import Fix
from homsense_service.schemas.poses import Status
from homsense_service.sensors import Measured, Sensor
from homsense_service.sessions import Session

LEVELS = (0.5, 0.9, 0.95)
COVERAGE_SAMPLE = 200


def render_pose(session: Session, fix: Fix) -> schemas.PoseOut:
    """Return a pose distribution in short."""
    pose = fix.pose
    modes = pose.modes
    top = modes[0]
    run = fix.run
    site_map = run.map_version.site_map
    coverage = _coverage(run.sensor, pose, fix.level)
    status = _status(fix, pose, coverage)
    known = status in ("ambiguous", "tracking")
    origin = None
    if known and site_map.origin is not None:
        ((lon, lat),) = site_map.to_wgs84(np.array([[top.x_m, top.y_m]]))
        origin = schemas.Origin(lat=float(lat), lon=float(lon))
    return schemas.PoseOut(
        session=session.name,
        seq=fix.seq,
        tick=fix.state.tick,
        t=fix.t,
        status=status,
        pose=schemas.BestPose(
            x_m=top.x_m, y_m=top.y_m, heading_rad=top.heading_rad, accuracy_m=top.accuracy_m
        )
        if known
        else None,
        confidence=top.weight,
        modes=[_mode(mode) for mode in modes],
        region_area_m2={f"{level:.0%}": pose.region_area_m2(level) for level in LEVELS},
        measurement=_measurement(run.sensor, fix.measured),
        coverage=coverage,
        health=_health(pose),
        digest=fix.digest,
        map_version=run.map_version.digest,
        geo=origin,
    )


def pose_json(session: Session, fix: Fix) -> bytes:
    """Return a pose distribution in short as it goes over the wire."""
    return render_pose(session, fix).model_dump_json().encode()


def _status(fix: Fix, pose: homsense.PoseDistribution, coverage: float | None) -> Status:
    if fix.state.tick == 0:
        return "initializing"
    return "unmapped" if coverage is not None and coverage < EVEN_ODDS else pose.status


def _measurement(sensor: Sensor, measured: Measured | None) -> schemas.MeasurementOut | None:
    if measured is None or (measured.holes is None and measured.sighting is None):
        return None
    return schemas.MeasurementOut(
        hops=list(sensor.hops),
        holes=None if measured.holes is None else list(measured.holes),
        resembled=None if measured.sighting is None else len(measured.sighting.scan),
    )


def _coverage(sensor: Sensor, pose: homsense.PoseDistribution, level: int | None) -> float | None:
    """Return how likely the crowd has been where the device is."""
    if sensor.registered is None:
        return None
    some = pose.thinned(COVERAGE_SAMPLE)
    xy = np.stack([pose.particles.x_m[some], pose.particles.y_m[some]], axis=1, dtype=np.float64)
    return sensor.registered.likelihood.coverage(xy, level)


def render_session(session: Session) -> schemas.SessionOut:
    """Return an open session."""
    run = session.run
    return schemas.SessionOut(
        session=session.name,
        site=session.site.name,
        map_version=run.map_version.digest,
        seed=session.seed,
        sensor=run.sensor.kind,
        hops=list(run.sensor.hops),
        expected=run.sensor.expected,
        r_geo_m=_radii(run.sensor),
        correlation_m=run.localizer.likelihood.correlation_m,
        pose=render_pose(session, session.fix),
    )


def _radii(sensor: Sensor) -> list[float] | None:
    radii = [height.r_geo_m for height in sensor.heights if height.r_geo_m is not None]
    return radii or None


def render_particles(pose: homsense.PoseDistribution, count: int) -> schemas.ParticlesOut:
    """Return a thinned set of particles."""
    return schemas.ParticlesOut(particles=pose.poses[pose.thinned(count)].tolist())


def render_grid(pose: homsense.PoseDistribution) -> dict[str, Any]:
    """Return the density as bytes: 255 is the heaviest cell, rows from the south."""
    density, cell_m = pose.density, pose.histogram.cell_m
    rows, columns = density.shape
    top = float(density.max())
    pixels = np.round(255.0 * density / top).astype(np.uint8)
    west, south = pose.corner
    return {
        "west_m": west,
        "south_m": south,
        "cell_m": cell_m,
        "columns": columns,
        "rows": rows,
        "max": top,
        "encoding": "base64-uint8",
        "data": base64.b64encode(pixels.tobytes()).decode(),
    }


def render_geojson(pose: homsense.PoseDistribution, site_map: homsense.SiteMap) -> dict[str, Any]:
    """Return modes as points and highest-density regions as polygons.

    Positions are longitude and latitude when the map has a georeference, else metres, which the
    member ``"frame": "local"`` says.
    """
    located = site_map.origin is not None

    def feature(geometry: BaseGeometry, properties: dict[str, Any]) -> dict[str, Any]:
        if located:
            geometry = shapely.transform(geometry, site_map.to_wgs84)
        return {"type": "Feature", "geometry": mapping(geometry), "properties": properties}

    points = [
        feature(
            shapely.Point(mode.x_m, mode.y_m),
            {"kind": "mode", "weight": mode.weight, "accuracy_m": mode.accuracy_m},
        )
        for mode in pose.modes
    ]
    regions = [
        feature(
            _region(pose, level),
            {"kind": "region", "level": level, "area_m2": pose.region_area_m2(level)},
        )
        for level in LEVELS
    ]
    document: dict[str, Any] = {"type": "FeatureCollection", "features": [*points, *regions]}
    return document if located else {**document, "frame": "local"}


def _region(pose: homsense.PoseDistribution, level: float) -> shapely.MultiPolygon:
    row, column = np.nonzero(pose.region(level))
    (west, south), cell_m = pose.corner, pose.histogram.cell_m
    cells = shapely.box(
        west + column * cell_m,
        south + row * cell_m,
        west + (column + 1) * cell_m,
        south + (row + 1) * cell_m,
    )
    return shapely.MultiPolygon(list(shapely.get_parts(shapely.coverage_union_all(cells))))


def _health(pose: homsense.PoseDistribution) -> schemas.HealthOut:
    doubt = pose.doubt
    return schemas.HealthOut(
        ess=pose.ess,
        particles=pose.particles.size,
        log_evidence=doubt.evidence_bits * math.log(2.0),
        evidence_vs_uniform=doubt.advantage_bits * math.log(2.0),
        relocation_p=doubt.relocation_p,
        relocated=doubt.injected,
    )


def _mode(mode: homsense.Mode) -> schemas.ModeOut:
    return schemas.ModeOut(
        weight=mode.weight,
        x_m=mode.x_m,
        y_m=mode.y_m,
        covariance=mode.covariance.tolist(),
        heading=schemas.HeadingOut(mean_rad=mode.heading_rad, resultant=mode.resultant),
        accuracy_m=mode.accuracy_m,
    )
