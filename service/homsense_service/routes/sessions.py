"""Sessions: localizing a device."""

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Header, Query, Response

from homsense_service import rendering_poses as rendering
from homsense_service import schemas
from homsense_service.routes.access import (
    CallerDep,
    MetricsDep,
    OperationsDep,
    SessionParam,
    SiteParam,
    StreamsDep,
    needs,
    problems,
)
from homsense_service.routes.pages import CursorParam, LimitParam, page

router = APIRouter(prefix="/v1", tags=["sessions"])


@router.post(
    "/sites/{site}/sessions",
    status_code=201,
    dependencies=[needs("localize")],
    summary="Open a session",
    responses=problems(400, 404, 409, 413, 422, 503),
)
def open_session(
    site: SiteParam,
    request: schemas.SessionIn,
    operations: OperationsDep,
    caller: CallerDep,
    idempotency_key: Annotated[
        str | None, Header(min_length=1, max_length=200, description="Names the request.")
    ] = None,
) -> schemas.SessionOut:
    """Start localizing a device on the current map of a site.

    With an ``Idempotency-Key`` the same request gets the same session again.
    """
    asked_as = None if idempotency_key is None else f"key {caller.name} {idempotency_key}"
    return rendering.render_session(operations.open_session(site, request, asked_as))


@router.get(
    "/sites/{site}/sessions",
    dependencies=[needs("localize")],
    summary="List sessions",
    responses=problems(404, 422),
)
def list_sessions(
    site: SiteParam,
    operations: OperationsDep,
    limit: LimitParam = 100,
    cursor: CursorParam = None,
) -> schemas.SessionList:
    """Return the identifiers of the sessions of a site."""
    of_site = operations.sessions.of_site(operations.sites.get(site).name)
    names, following = page(of_site, limit, cursor)
    return schemas.SessionList(sessions=names, next=following)


@router.post(
    "/sessions/{session}/steps",
    dependencies=[needs("localize")],
    summary="Post motion and scans",
    response_model=schemas.PoseOut,
    responses=problems(400, 404, 409, 413, 422),
)
def post_steps(
    session: SessionParam,
    batch: schemas.StepsIn,
    operations: OperationsDep,
    metrics: MetricsDep,
    streams: StreamsDep,
) -> Response:
    """Apply steps in the order of ``seq`` and return the pose after the last.

    Repeating a request answers as before and changes nothing.
    """
    pose = operations.take_steps(session, batch.steps, rendering.pose_json)
    metrics.steps.inc(len(batch.steps))
    streams.publish(session, pose)
    return Response(pose, media_type="application/json")


@router.post(
    "/sessions/{session}/map",
    dependencies=[needs("localize")],
    summary="Move to the current map",
    responses=problems(404, 409, 422),
)
def move_to_current_map(session: SessionParam, operations: OperationsDep) -> schemas.SessionOut:
    """Let a session go on with the current map of its site.

    A session stays on the map it was opened on until it is moved. Its particles stay where they
    are; those that the new map has no room for lose their weight.
    """
    return rendering.render_session(operations.move_session(session))


@router.get(
    "/sessions/{session}/pose",
    dependencies=[needs("localize")],
    summary="The pose",
    response_model=schemas.PoseOut,
    responses=problems(404, 422),
)
def get_pose(session: SessionParam, operations: OperationsDep) -> Response:
    """Return what is known about the pose."""
    pose = operations.answer(session, rendering.pose_json)
    return Response(pose, media_type="application/json")


@router.get(
    "/sessions/{session}/particles",
    dependencies=[needs("localize")],
    summary="Particles",
    responses=problems(404, 422),
)
def get_particles(
    session: SessionParam,
    operations: OperationsDep,
    n: Annotated[int, Query(ge=1, le=10_000, description="How many.")] = 500,
) -> schemas.ParticlesOut:
    """Return particles of equal weight that represent all."""
    return rendering.render_particles(operations.sessions.get(session).fix.pose, n)


@router.get(
    "/sessions/{session}/distribution",
    dependencies=[needs("localize")],
    summary="The distribution",
    responses=problems(404, 422),
)
def get_distribution(
    session: SessionParam,
    operations: OperationsDep,
    format: Annotated[  # noqa: A002 - the name of the query parameter
        Literal["geojson", "grid"], Query(description="Modes and regions, or the density.")
    ] = "geojson",
) -> dict[str, Any]:
    """Return the distribution as GeoJSON or as a grid."""
    found = operations.sessions.get(session)
    if format == "grid":
        return rendering.render_grid(found.fix.pose)
    return rendering.render_geojson(found.fix.pose, found.run.map_version.site_map)


@router.delete(
    "/sessions/{session}",
    status_code=204,
    dependencies=[needs("localize")],
    summary="Close a session",
    responses=problems(404, 422),
)
def close_session(session: SessionParam, operations: OperationsDep, streams: StreamsDep) -> None:
    """Forget a session."""
    operations.sessions.close(session)
    streams.end(session)
