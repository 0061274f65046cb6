"""Values -> wire: poses, distributions, height maps and complexes."""

import base64
import io
import math
from typing import Any

import networkx as nx
import numpy as np
import shapely
from PIL import Image
from shapely.geometry import mapping
from shapely.geometry.base import BaseGeometry

import homsense
from homsense.cycles import round_holes
from homsense.registered.complex import is_unmapped
from homsense.skeleton import n_edges, skeleton
from homsense_service import schemas
from homsense_service.operations import Sensed
from homsense_service.schemas.poses import Status
from homsense_service.sensors import Measured, Sensor
from homsense_service.sessions import Fix, Session
from homsense_service.site import Site
from homsense_service.versions import ComplexVersion, MapVersion, WitnessCheck

LEVELS = (0.5, 0.9, 0.95)
MAX_MODES = 16
COVERAGE_SAMPLE = 200
MAX_BESIDE = 8
EULER_TERMS = 20_000


def render_site(site: Site) -> schemas.SiteOut:
    """Return a site and what it holds."""
    return schemas.SiteOut(
        site=site.name,
        config=schemas.SiteIn.from_config(site.config),
        map_version=None if site.map is None else site.map.digest,
        observations=site.complex.number,
        landmarks=site.complex.landmark_complex.n_landmarks,
    )


def render_map(version: MapVersion) -> schemas.MapOut:
    """Return what became of a map."""
    site_map = version.site_map
    origin = site_map.origin
    return schemas.MapOut(
        version=version.digest,
        structures=len(site_map.structures),
        courtyards=len(site_map.courtyards),
        bounds_m=list(site_map.bounds),
        free_area_m2=float(site_map.free_space.area),
        origin=None if origin is None else schemas.Origin(lat=origin[0], lon=origin[1]),
    )


def render_complex(version: ComplexVersion) -> schemas.ComplexOut:
    """Return the numbers of a complex."""
    grown = version.sensed
    return schemas.ComplexOut(
        version=version.number,
        digest=grown.digest(),
        observations=version.number,
        devices=len(version.devices),
        landmarks=grown.n_landmarks,
        facets=grown.n_facets,
        edges=n_edges(grown),
        betti=list(grown.betti_numbers()),
        euler=_euler(grown),
        quorum=version.filtration.depth,
        quarantined=[_quarantined(found) for found in version.quarantine],
        raw=schemas.RawComplexOut(
            landmarks=version.raw.n_landmarks,
            facets=version.raw.n_facets,
            betti=list(version.raw.betti_numbers()),
        ),
    )


def _quarantined(found: homsense.Displaced) -> schemas.QuarantinedOut:
    way = "nothing else joins" if found.hops_apart is None else f"are {found.hops_apart} hops"
    apart = "" if found.hops_apart is None else " apart without it"
    return schemas.QuarantinedOut(
        landmark=found.landmark,
        reason=f"it was seen at two places that {way}{apart}",
        hops_apart=found.hops_apart,
        here=list(found.here[:MAX_BESIDE]),
        there=list(found.there[:MAX_BESIDE]),
    )


def render_facets(grown: homsense.LandmarkComplex) -> dict[str, Any]:
    """Return the facets in lexicographic order."""
    return {"facets": sorted(sorted(facet) for facet in grown.facets)}


def render_hif(grown: homsense.LandmarkComplex) -> dict[str, Any]:
    """Return the complex in the hypergraph interchange format: facets are edges."""
    facets = render_facets(grown)["facets"]
    return {
        "network-type": "asc",
        "metadata": {"generator": "homsense", "digest": grown.digest()},
        "nodes": [{"node": landmark} for landmark in sorted(grown.landmarks)],
        "edges": [{"edge": number} for number in range(len(facets))],
        "incidences": [
            {"edge": number, "node": landmark}
            for number, facet in enumerate(facets)
            for landmark in facet
        ],
    }


def render_node_link(grown: homsense.LandmarkComplex) -> dict[str, Any]:
    """Return the 1-skeleton as node-link data."""
    data: dict[str, Any] = nx.node_link_data(skeleton(grown), edges="edges")
    return data


def render_range_curve(site: Site, curve: list[homsense.RangePoint]) -> schemas.RangeCurveOut:
    """Return the range self-check of a site."""
    chosen = homsense.choose_cut(curve)
    return schemas.RangeCurveOut(
        version=site.complex.number,
        min_rssi_dbm=site.config.min_rssi_dbm,
        chosen_min_rssi_dbm=None if chosen is None else chosen.min_rssi_dbm,
        points=[
            schemas.RangePointOut(
                min_rssi_dbm=point.min_rssi_dbm,
                landmarks_per_scan=point.landmarks_per_scan,
                landmarks=point.landmarks,
                facets=point.facets,
                betti=list(point.betti),
                euler=point.euler,
                alarm=point.alarm,
                stable=point.stable,
            )
            for point in curve
        ],
    )


def render_witness_curve(site: Site, check: WitnessCheck) -> schemas.WitnessCurveOut:
    """Return the witness check of a site."""
    return schemas.WitnessCurveOut(
        version=site.complex.number,
        quorum=site.config.quorum,
        median_witnesses=check.median_witnesses,
        suggested_quorum=homsense.suggested_quorum(check.median_witnesses),
        points=[
            schemas.WitnessPointOut(
                witnesses=point.witnesses,
                landmarks=point.landmarks,
                facets=point.facets,
                betti=list(point.betti),
                lasting=point.lasting,
            )
            for point in check.points
        ],
    )


def render_sensed(sensed: Sensed, *, cycles: bool) -> schemas.LocalHomologyOut:
    """Return the answer of the homological sensor, with cycles on request."""
    version = sensed.site.complex
    return schemas.LocalHomologyOut(
        complex_version=version.number,
        known=len(version.landmark_complex.numbers(sensed.visible - version.left_out)),
        levels=[
            _level(level, raw, cycles=cycles)
            for level, raw in zip(sensed.levels, sensed.raw, strict=True)
        ],
    )


def _level(
    level: homsense.LocalHomology, raw: homsense.LocalHomology, *, cycles: bool
) -> schemas.Level:
    return schemas.Level(
        hops=level.hops,
        r_pseudo_m=level.r_pseudo_m,
        vertices=level.n_landmarks,
        facets=level.n_facets,
        betti=list(level.betti),
        euler=_euler(level.subcomplex),
        holes=level.holes,
        raw_holes=raw.holes,
        lasting=level.lasting,
        cycles=list(map(list, round_holes(level.subcomplex.facets))) if cycles else None,
    )


def render_height_map(sensor: Sensor) -> schemas.HeightMapOut:
    """Return the height map of a sensor with one neighborhood as numbers."""
    height, *spreads = sensor.heights
    grid = height.grid
    return schemas.HeightMapOut(
        hops=sensor.hops[0],
        expected="simulated" if spreads else "geometric",
        r_geo_m=height.r_geo_m,
        cell_m=grid.cell_m,
        west_m=grid.west_m,
        south_m=grid.south_m,
        columns=grid.columns,
        rows=grid.rows,
        values=_rows(height),
        spread=_rows(spreads[0]) if spreads else None,
    )


def _rows(height: homsense.HeightMap) -> list[list[float | None]]:
    return [
        [None if math.isnan(value) else value for value in row] for row in height.values.tolist()
    ]


def render_height_png(height: homsense.HeightMap) -> bytes:
    """Return a height map as a grey picture, north up, white for the most holes."""
    values = np.nan_to_num(height.values[::-1])
    top = max(1.0, float(values.max()))
    pixels = np.round(255.0 * values / top).astype(np.uint8)
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, format="PNG")
    return buffer.getvalue()


def render_pose(session: Session, fix: Fix) -> schemas.PoseOut:
    """Return a pose distribution in short."""
    pose = fix.pose
    modes = pose.modes
    top = modes[0]
    coverage = _coverage(session.sensor, pose)
    status = _status(fix, coverage)
    known = status in ("ambiguous", "tracking")
    origin = None
    if known and session.map_version.site_map.origin is not None:
        ((lon, lat),) = session.map_version.site_map.to_wgs84(np.array([[top.x_m, top.y_m]]))
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
        modes=[_mode(mode) for mode in modes[:MAX_MODES]],
        region_area_m2={f"{level:.0%}": pose.region_area_m2(level) for level in LEVELS},
        measurement=_measurement(session.sensor, fix.measured),
        coverage=coverage,
        health=_health(fix),
        digest=fix.state.digest(),
        map_version=session.map_version.digest,
        geo=origin,
    )


def _status(fix: Fix, coverage: float | None) -> Status:
    if fix.state.tick == 0:
        return "initializing"
    status = fix.pose.status
    return "unmapped" if coverage is not None and is_unmapped(status, coverage) else status


def _measurement(sensor: Sensor, measured: Measured | None) -> schemas.MeasurementOut | None:
    if measured is None or (measured.holes is None and measured.sighting is None):
        return None
    return schemas.MeasurementOut(
        hops=list(sensor.hops),
        holes=None if measured.holes is None else list(measured.holes),
        resembled=None if measured.sighting is None else len(measured.sighting.scan),
    )


def _coverage(sensor: Sensor, pose: homsense.PoseDistribution) -> float | None:
    """Return how much of the distribution lies where the crowd has been."""
    if sensor.registered is None:
        return None
    some = pose.poses[pose.thinned(COVERAGE_SAMPLE), :2]
    return float(sensor.registered.complex.covers(some).mean())


def render_session(session: Session) -> schemas.SessionOut:
    """Return an open session."""
    return schemas.SessionOut(
        session=session.name,
        site=session.site.name,
        map_version=session.map_version.digest,
        seed=session.seed,
        sensor=session.sensor.kind,
        hops=list(session.sensor.hops),
        expected=session.sensor.expected,
        r_geo_m=_radii(session.sensor),
        correlation_m=session.localizer.likelihood.correlation_m,
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
        for mode in pose.modes[:MAX_MODES]
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
    x, y = west + column * cell_m, south + row * cell_m
    cells = shapely.union_all(shapely.box(x, y, x + cell_m, y + cell_m))
    return shapely.MultiPolygon(list(shapely.get_parts(cells)))


def _health(fix: Fix) -> schemas.HealthOut:
    doubt = fix.pose.doubt
    return schemas.HealthOut(
        ess=fix.pose.ess,
        particles=fix.pose.particles.size,
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


def _euler(grown: homsense.LandmarkComplex) -> int | None:
    try:
        return grown.euler_characteristic(max_terms=EULER_TERMS)
    except homsense.ComputationLimitError:
        return None
