"""Operation and problems on the wire."""

from typing import Literal

from homsense_service.schemas.wire import Wire


class HealthzOut(Wire):
    """The process lives."""

    status: Literal["ok"]


class InfoOut(Wire):
    """What this service is."""

    name: str
    version: str
    sites: int
    sessions: int


class FieldError(Wire):
    """An offending member of the request."""

    field: str
    message: str


class Problem(Wire):
    """RFC 9457 problem details."""

    type: str
    title: str
    status: int
    code: str
    detail: str
    errors: list[FieldError] | None = None
