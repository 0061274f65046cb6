"""Errors -> problem+json, for every route alike."""

import logging
import re
from collections.abc import Mapping, Sequence
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse

import homsense
from homsense_service.errors import RateLimitError, ServiceError, UnauthorizedError
from homsense_service.garbage import let_go
from homsense_service.problems import (
    INTERNAL,
    INVALID_REQUEST,
    MALFORMED_JSON,
    MEDIA_TYPE,
    Kind,
    kind_of,
    problem,
)

NOT_ALLOWED, UNAVAILABLE = 405, 503

_log = logging.getLogger(__name__)


def install(app: FastAPI) -> None:
    """Answer every error of an application with a problem."""
    app.add_exception_handler(RequestValidationError, _invalid_request)
    app.add_exception_handler(HTTPException, _http_error)
    app.add_exception_handler(ServiceError, _known_error)
    app.add_exception_handler(homsense.HomsenseError, _known_error)
    app.add_exception_handler(Exception, _internal)


def _answer(kind: Kind, detail: str, headers: dict[str, str] | None = None) -> JSONResponse:
    body = problem(kind, detail)
    return JSONResponse(body, status_code=kind.status, media_type=MEDIA_TYPE, headers=headers)


async def _invalid_request(_request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, RequestValidationError)
    found: Sequence[dict[str, Any]] = error.errors()
    if any(entry["type"] == "json_invalid" for entry in found):
        let_go(error)
        return _answer(MALFORMED_JSON, "the body cannot be read as JSON")
    body = invalid_request(found)
    return JSONResponse(body, status_code=INVALID_REQUEST.status, media_type=MEDIA_TYPE)


def invalid_request(found: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the problem of a request that breaks the schema."""
    fields = [(_path(entry["loc"]), str(entry["msg"])) for entry in found]
    path, message = fields[0]
    return problem(INVALID_REQUEST, f"{path}: {message}", fields)


async def _http_error(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, HTTPException)
    detail = str(error.detail)
    headers = {name.lower(): value for name, value in (error.headers or {}).items()}
    if error.status_code == NOT_ALLOWED:
        headers["allow"] = ", ".join(sorted(await run_in_threadpool(_methods, request)))
    if error.status_code == MALFORMED_JSON.status:
        return _answer(MALFORMED_JSON, detail)
    kind = Kind(error.status_code, detail.lower().replace(" ", "_"), detail)
    return _answer(kind, detail, headers=headers)


def _methods(request: Request) -> set[str]:
    """Return the methods of all routes with the path of a request."""
    found: set[str] = set()
    for path, verbs in request.app.openapi()["paths"].items():
        pattern = re.sub(r"\\\{[^}]*\\\}", "[^/]+", re.escape(path))
        if re.fullmatch(pattern, request.url.path):
            found |= {verb.upper() for verb in verbs}
    return found


async def _known_error(_request: Request, error: Exception) -> JSONResponse:
    return refusal(error)


def refusal(error: Exception) -> JSONResponse:
    """Return the answer to a known error."""
    kind = kind_of(error)
    return JSONResponse(
        known_problem(error),
        status_code=kind.status,
        media_type=MEDIA_TYPE,
        headers=_headers(kind, error),
    )


def known_problem(error: Exception) -> dict[str, Any]:
    """Return the problem of a known error."""
    path = getattr(error, "field", None)
    fields = None if path is None else [(path, str(error))]
    return problem(kind_of(error), str(error), fields)


def _headers(kind: Kind, error: Exception) -> dict[str, str] | None:
    if isinstance(error, RateLimitError):
        return {"Retry-After": str(error.retry_after_s)}
    if isinstance(error, UnauthorizedError):
        return {"WWW-Authenticate": "Bearer"}
    return {"Retry-After": "5"} if kind.status == UNAVAILABLE else None


async def _internal(request: Request, error: Exception) -> JSONResponse:
    _log.error("%s %s failed", request.method, request.url.path, exc_info=error)
    return _answer(INTERNAL, "the failure was logged")


def _path(location: Sequence[str | int]) -> str:
    """Return a dotted path without the part of the request and without union branches."""
    parts = [str(part) for part in location]
    inside = parts[1:] if parts and parts[0] in ("body", "query", "path") else parts
    return ".".join(inside) or "".join(parts[:1]) or "body"
