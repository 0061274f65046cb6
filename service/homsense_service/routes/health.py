"""Operation: is it alive, what is it."""

from importlib.metadata import version
from typing import Literal

from fastapi import APIRouter, Request, Response
from fastapi.responses import PlainTextResponse
from prometheus_client import CONTENT_TYPE_LATEST

from homsense_service import schemas
from homsense_service.bridge.joining import Joining
from homsense_service.errors import StoreError
from homsense_service.routes.access import (
    CallerDep,
    MetricsDep,
    OperationsDep,
    described_problems,
    needs,
    problems,
)

STUCK_S = 10.0

router = APIRouter(tags=["operation"])


@router.get("/healthz", summary="Liveness")
async def healthz() -> schemas.HealthzOut:
    """Answer as long as the process does."""
    return schemas.HealthzOut(status="ok")


@router.get("/readyz", summary="Readiness", responses=described_problems(503))
def readyz(request: Request, operations: OperationsDep, counted: MetricsDep) -> schemas.ReadyzOut:
    """Answer when the store does: its sites are read again, and what waits is told."""
    operations.check()
    age_s = operations.commit_age_s()
    if age_s > STUCK_S:
        message = f"a transaction has not come to its end for {age_s:.0f} s"
        raise StoreError(message)
    joining: Joining | None = request.app.state.joining
    network: Literal["none", "joined", "waiting"] = "none"
    if joining is not None:
        network = "joined" if joining.is_joined else "waiting"
    return schemas.ReadyzOut(
        status="ok", commit_age_s=age_s, pending_requests=counted.pending, network=network
    )


@router.get(
    "/metrics",
    dependencies=[needs("read")],
    summary="Metrics",
    response_class=PlainTextResponse,
    responses=problems(),
)
def metrics(counted: MetricsDep, caller: CallerDep) -> Response:
    """Return counters and latencies in the text format of Prometheus."""
    caller.check_everywhere()
    return Response(counted.exposition(), media_type=CONTENT_TYPE_LATEST)


@router.get(
    "/v1/info",
    dependencies=[needs("read")],
    summary="What this service is",
    responses=problems(),
)
def info(operations: OperationsDep, caller: CallerDep) -> schemas.InfoOut:
    """Return the version and how much is loaded."""
    return schemas.InfoOut(
        name="homsense",
        version=version("homsense"),
        sites=sum(caller.sees(site.name) for site in operations.sites.all()),
        sessions=sum(caller.sees(of) for of in operations.sessions.sites()),
    )
