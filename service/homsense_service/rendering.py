"""Values -> wire: sites, height maps and complexes."""

import io
import math
from importlib import import_module
from typing import Any

import numpy as np
from PIL import Image

import homsense
from homsense.cycles import round_holes
from homsense.range_check import quick_euler
from homsense.skeleton import skeleton
from homsense_service import schemas
from homsense_service.operations import Sensed
from homsense_service.sensors import Sensor
from homsense_service.site import Site
from homsense_service.versions import ComplexVersion, MapVersion, WitnessCheck

MAX_BESIDE = 8


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
    counts = version.counts
    return schemas.ComplexOut(
        version=version.number,
        digest=counts.digest,
        observations=version.number,
        devices=len(version.devices),
        landmarks=counts.landmarks,
        facets=counts.facets,
        edges=counts.edges,
        betti=list(counts.betti),
        euler=counts.euler,
        quorum=version.filtration.depth,
        quarantined=[_quarantined(found) for found in version.quarantine],
        raw=schemas.RawComplexOut(
            landmarks=version.raw.n_landmarks,
            facets=version.raw.n_facets,
            betti=list(counts.raw_betti),
        ),
    )


def _quarantined(found: homsense.Displaced) -> schemas.QuarantinedOut:
    apart = found.hops_apart
    way = "nothing else joins" if apart is None else f"are {apart:.1f} hops apart without it"
    return schemas.QuarantinedOut(
        landmark=found.landmark,
        reason=f"it was seen at two places that {way}",
        hops_apart=None if apart is None else round(apart, 1),
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
    data: dict[str, Any] = import_module("networkx").node_link_data(skeleton(grown), edges="edges")
    return data


def render_range_curve(
    site: Site, scans: int, curve: list[homsense.RangePoint]
) -> schemas.RangeCurveOut:
    """Return the range self-check of a site over some of its scans."""
    chosen = homsense.choose_cut(curve)
    return schemas.RangeCurveOut(
        version=site.complex.number,
        scans=scans,
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


def render_witness_curve(site: Site, scans: int, check: WitnessCheck) -> schemas.WitnessCurveOut:
    """Return the witness check of a site over some of its scans."""
    return schemas.WitnessCurveOut(
        version=site.complex.number,
        scans=scans,
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
        euler=quick_euler(level.subcomplex),
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
