"""Operation: is it alive, what is it."""

from importlib.metadata import version

from fastapi import APIRouter, Response
from fastapi.responses import PlainTextResponse
from prometheus_client import CONTENT_TYPE_LATEST

from homsense_service import schemas
from homsense_service.routes.access import MetricsDep, OperationsDep, problems

router = APIRouter(tags=["operation"])


@router.get("/healthz", summary="Liveness")
def healthz() -> schemas.HealthzOut:
    """Answer as long as the process does."""
    return schemas.HealthzOut(status="ok")


@router.get("/readyz", summary="Readiness", responses=problems(503))
def readyz(operations: OperationsDep) -> schemas.HealthzOut:
    """Answer when the store does: its sites are read again."""
    operations.check()
    return schemas.HealthzOut(status="ok")


@router.get("/metrics", summary="Metrics", response_class=PlainTextResponse)
def metrics(counted: MetricsDep) -> Response:
    """Return counters and latencies in the text format of Prometheus."""
    return Response(counted.exposition(), media_type=CONTENT_TYPE_LATEST)


@router.get("/v1/info", summary="What this service is")
def info(operations: OperationsDep) -> schemas.InfoOut:
    """Return the version and how much is loaded."""
    return schemas.InfoOut(
        name="homsense",
        version=version("homsense"),
        sites=len(operations.sites.all()),
        sessions=len(operations.sessions),
    )
