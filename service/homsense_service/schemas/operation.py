"""Operation and problems on the wire."""

from typing import Literal

from pydantic import Field

from homsense_service.schemas.wire import Wire


class HealthzOut(Wire):
    """The process lives."""

    status: Literal["ok"]


class ReadyzOut(Wire):
    """The store answers."""

    status: Literal["ok"]
    commit_age_s: float = Field(description="Of the transaction at hand; 0 between two.")
    pending_requests: int = Field(description="Requests that wait for their answers.")
    network: Literal["none", "joined", "waiting"] = Field(
        description="Whether devices can reach it over zenoh; waiting: for a router."
    )


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
