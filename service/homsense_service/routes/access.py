"""What every route needs: the operations, and how errors are described in OpenAPI."""

from typing import Annotated, Any

from fastapi import Depends, Path, Request

from homsense_service.metrics import Metrics
from homsense_service.operations import Operations
from homsense_service.problems import MEDIA_TYPE

SiteParam = Annotated[
    str, Path(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$", description="Name of the site.")
]
SessionParam = Annotated[str, Path(max_length=64, description="Identifier of the session.")]


def _operations(request: Request) -> Operations:
    operations: Operations = request.app.state.operations
    return operations


def _metrics(request: Request) -> Metrics:
    metrics: Metrics = request.app.state.metrics
    return metrics


OperationsDep = Annotated[Operations, Depends(_operations)]
MetricsDep = Annotated[Metrics, Depends(_metrics)]


def problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI description of error answers."""
    content = {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}
    described = {400: "Malformed", 404: "Not found", 409: "Conflict", 413: "Too large"}
    described |= {422: "Invalid", 503: "Full"}
    return {status: {"description": described[status], "content": content} for status in statuses}
