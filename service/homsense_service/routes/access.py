"""What every route needs: the operations, and how errors are described in OpenAPI."""

from typing import Annotated, Any

from fastapi import Depends, Path, Request, Security
from fastapi.security import HTTPBearer
from starlette.requests import HTTPConnection

from homsense_service.errors import SessionNotFoundError, SiteNotFoundError
from homsense_service.keys import ANYBODY, Caller, KeyRing, Scope
from homsense_service.limiting import RateLimit
from homsense_service.metrics import Metrics
from homsense_service.operations import Operations
from homsense_service.problems import MEDIA_TYPE
from homsense_service.schemas.wire import NAME
from homsense_service.streams import Streams

SiteParam = Annotated[str, Path(pattern=NAME, description="Name of the site.")]
SessionParam = Annotated[str, Path(max_length=64, description="Identifier of the session.")]


async def _operations(request: Request) -> Operations:
    operations: Operations = request.app.state.operations
    return operations


async def _metrics(request: Request) -> Metrics:
    metrics: Metrics = request.app.state.metrics
    return metrics


async def _keys(request: Request) -> KeyRing:
    keys: KeyRing = request.app.state.keys
    return keys


KeysDep = Annotated[KeyRing, Depends(_keys)]


async def _streams(request: Request) -> Streams:
    streams: Streams = request.app.state.streams
    return streams


StreamsDep = Annotated[Streams, Depends(_streams)]
OperationsDep = Annotated[Operations, Depends(_operations)]
MetricsDep = Annotated[Metrics, Depends(_metrics)]


async def caller_of(connection: HTTPConnection) -> Caller:
    """Return who calls, once that has been found out."""
    caller: Caller = connection.state.caller
    return caller


CallerDep = Annotated[Caller, Depends(caller_of)]


def admit(connection: HTTPConnection, scope: Scope) -> None:
    """Let a request pass when its key is good for it.

    A site that the key is not for, and its sessions, are answered like ones that do not exist.

    Parameters
    ----------
    connection : HTTPConnection
        A request or a websocket, with its path parameters.
    scope : str
        What it is about.

    Raises
    ------
    ServiceError
        If it may not.
    """
    ring: KeyRing = connection.app.state.keys
    limit: RateLimit = connection.app.state.rate_limit
    kind, _, token = connection.headers.get("authorization", "").partition(" ")
    caller = ring.caller(token.strip() if kind.lower() == "bearer" else None)
    address = "" if connection.client is None else connection.client.host
    limit.hit(f"address {address}" if caller is ANYBODY else f"key {caller.name}")
    connection.state.caller = caller
    parameters = connection.path_params
    site = parameters.get("site")
    if site is not None and not caller.sees(site):
        raise SiteNotFoundError(site)
    session = parameters.get("session")
    if session is not None and caller.sites is not None:
        operations: Operations = connection.app.state.operations
        if not caller.sees(operations.sessions.site_of(session)):
            raise SessionNotFoundError(session)
    caller.check(scope)


_bearer = HTTPBearer(auto_error=False, description="A key; needed when the service has keys.")


def needs(scope: Scope) -> Any:  # noqa: ANN401 - FastAPI's own type for dependencies
    """Return the dependency that lets only keys with a scope pass."""

    async def admitted(
        request: Request, _told: Annotated[object, Security(_bearer)] = None
    ) -> None:
        admit(request, scope)

    return Depends(admitted)


def problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI description of error answers, and of those that every route has."""
    return described_problems(*statuses, 401, 403, 429, 503)


def described_problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI description of some error answers."""
    content = {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}
    described = {400: "Malformed", 404: "Not found", 409: "Conflict", 413: "Too large"}
    described |= {401: "Unknown key", 403: "Not with this key", 412: "Another version"}
    described |= {422: "Invalid", 429: "Too many", 503: "Full"}
    return {status: {"description": described[status], "content": content} for status in statuses}
