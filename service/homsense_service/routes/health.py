"""Operation: is it alive, what is it."""

from importlib.metadata import version

from fastapi import APIRouter

from homsense_service import schemas
from homsense_service.routes.access import OperationsDep

router = APIRouter(tags=["operation"])


@router.get("/healthz", summary="Liveness")
def healthz() -> schemas.HealthzOut:
    """Answer as long as the process does."""
    return schemas.HealthzOut(status="ok")


@router.get("/v1/info", summary="What this service is")
def info(operations: OperationsDep) -> schemas.InfoOut:
    """Return the version and how much is loaded."""
    return schemas.InfoOut(
        name="homsense",
        version=version("homsense"),
        sites=len(operations.sites.all()),
        sessions=len(operations.sessions),
    )
