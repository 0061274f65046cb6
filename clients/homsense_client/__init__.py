"""The SDK: talk to a homsense service, blocking or asynchronous."""

from homsense_client._async_client import AsyncClient, AsyncSession
from homsense_client._client import Client, Session
from homsense_client._learnt import (
    Diagnosis,
    Expectation,
    Finding,
    Learnt,
    Placed,
    Placement,
    Registration,
)
from homsense_client._models import (
    Complex,
    Level,
    LocalHomology,
    MapInfo,
    Mode,
    Pose,
    Receipt,
    SessionInfo,
    Site,
)
from homsense_client._retry import Retry
from homsense_client.errors import (
    ClientError,
    ConflictError,
    ConnectError,
    ContractError,
    InvalidRequestError,
    NotFoundError,
    RequestTimeoutError,
    ResponseError,
    TransportError,
    UnavailableError,
)

__all__ = [
    "AsyncClient",
    "AsyncSession",
    "Client",
    "ClientError",
    "Complex",
    "ConflictError",
    "ConnectError",
    "ContractError",
    "Diagnosis",
    "Expectation",
    "Finding",
    "InvalidRequestError",
    "Learnt",
    "Level",
    "LocalHomology",
    "MapInfo",
    "Mode",
    "NotFoundError",
    "Placed",
    "Placement",
    "Pose",
    "Receipt",
    "Registration",
    "RequestTimeoutError",
    "ResponseError",
    "Retry",
    "Session",
    "SessionInfo",
    "Site",
    "TransportError",
    "UnavailableError",
]
