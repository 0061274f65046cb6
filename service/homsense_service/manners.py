"""Headers that every answer has. Pure ASGI."""

import re
import secrets

import structlog
from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_TRACE = re.compile(r"00-([0-9a-f]{32})-[0-9a-f]{16}-[0-9a-f]{2}")
_HEADERS = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "x-frame-options": "DENY",
    "cross-origin-resource-policy": "same-origin",
}


class Manners:
    """Middleware that gives each request a name, for its answer and for the log.

    Parameters
    ----------
    app : ASGI application
        What handles the request.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        name = _request_id(scope)
        structlog.contextvars.bind_contextvars(request=name)

        async def mannered(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for header, value in _HEADERS.items():
                    headers.setdefault(header, value)
                headers["x-request-id"] = name
                if scope["path"].startswith("/v1/"):
                    headers.setdefault("cache-control", "no-store")
            await send(message)

        try:
            await self._app(scope, receive, mannered)
        finally:
            structlog.contextvars.unbind_contextvars("request")


def _request_id(scope: Scope) -> str:
    """Return the trace of the caller, or a name of our own."""
    given = dict(scope["headers"]).get(b"traceparent", b"").decode("latin-1")
    found = _TRACE.fullmatch(given)
    return found[1] if found else secrets.token_hex(16)
