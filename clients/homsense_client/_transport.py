"""Between the protocol and httpx, for both shells."""

from typing import Any

import httpx

from homsense_client._protocol import Call
from homsense_client.errors import ConnectError, RequestTimeoutError, TransportError


def authorization(key: str | None) -> dict[str, str]:
    """Return the headers that show a key."""
    return {} if key is None else {"authorization": f"Bearer {key}"}


def prepared(call: Call[Any]) -> dict[str, Any]:
    """Return the arguments of an httpx request."""
    return {
        "method": call.method,
        "url": call.path,
        "json": call.body,
        "params": call.params,
        "headers": call.headers,
    }


def parsed(answer: httpx.Response) -> object:
    """Return the JSON of an answer, None when it holds none."""
    try:
        return answer.json() if answer.content else None
    except ValueError:
        return None


def as_client_error(error: httpx.TransportError) -> TransportError:
    """Return the SDK's error for one of the transport."""
    if isinstance(error, httpx.TimeoutException):
        return RequestTimeoutError(f"no answer in time: {error}")
    if isinstance(error, httpx.ConnectError):
        return ConnectError(f"no connection: {error}")
    return TransportError(str(error) or type(error).__name__)
