"""Scans, the complex that they build, and its local homology."""

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query

from homsense_service import rendering, schemas
from homsense_service.routes.access import MetricsDep, OperationsDep, SiteParam, needs, problems
from homsense_service.site import Site
from homsense_service.sites import SiteRegistry

router = APIRouter(prefix="/v1/sites/{site}", tags=["scans"])


@router.post(
    "/scans",
    dependencies=[needs("ingest")],
    summary="Post scans",
    responses=problems(400, 404, 413, 422),
)
def post_scans(
    site: SiteParam, batch: schemas.ScansIn, operations: OperationsDep, metrics: MetricsDep
) -> schemas.ScansOut:
    """Take a batch of scans; the answer leaves after they are durable."""
    done = operations.ingest_scans(site, batch.scans)
    metrics.scans.labels("accepted").inc(done.accepted)
    metrics.scans.labels("duplicate").inc(done.duplicate)
    metrics.scans.labels("dropped").inc(len(done.dropped))
    for _, reason in done.dropped:
        metrics.dropped.labels(reason.partition(":")[0].partition(".")[0]).inc()
    return schemas.ScansOut(
        accepted=done.accepted,
        duplicate=done.duplicate,
        dropped=[schemas.Dropped(index=index, reason=reason) for index, reason in done.dropped],
        complex_version=done.complex_version,
    )


@router.get(
    "/complex",
    dependencies=[needs("read")],
    summary="The landmark complex",
    responses=problems(404, 422, 503),
)
def get_complex(
    site: SiteParam,
    operations: OperationsDep,
    format: Annotated[  # noqa: A002 - the name of the query parameter
        Literal["facets", "hif", "node-link"] | None,
        Query(description="Export the complex instead of its numbers."),
    ] = None,
    curve: Annotated[
        Literal["rssi", "witnesses"] | None,
        Query(description="What it would be over RSSI cuts, or over numbers of witnesses."),
    ] = None,
) -> schemas.ComplexOut | schemas.RangeCurveOut | schemas.WitnessCurveOut | dict[str, Any]:
    """Return the numbers of the complex, or the complex itself, or one of its self-checks."""
    found = operations.sites.get(site)
    if curve is not None:
        sites = operations.sites
        if curve == "rssi":
            return operations.ask((site, curve), lambda: _range_curve(sites, found))
        return operations.ask((site, curve), lambda: _witness_curve(sites, found))
    version = found.complex
    if format is None:
        return rendering.render_complex(version)
    exports = {
        "facets": rendering.render_facets,
        "hif": rendering.render_hif,
        "node-link": rendering.render_node_link,
    }
    return exports[format](version.landmark_complex)


def _range_curve(sites: SiteRegistry, site: Site) -> schemas.RangeCurveOut:
    scans = sites.checked_scans(site)
    return rendering.render_range_curve(site, len(scans), sites.range_curve(site, scans))


def _witness_curve(sites: SiteRegistry, site: Site) -> schemas.WitnessCurveOut:
    scans = sites.checked_scans(site)
    return rendering.render_witness_curve(site, len(scans), sites.witness_curve(site, scans))


@router.post(
    "/local-homology",
    dependencies=[needs("read")],
    summary="Count holes",
    responses=problems(400, 404, 413, 422),
)
def post_local_homology(
    site: SiteParam, question: schemas.LocalHomologyIn, operations: OperationsDep
) -> schemas.LocalHomologyOut:
    """Count the holes of the complex near a scan."""
    return rendering.render_sensed(operations.sense(site, question), cycles=question.cycles)
