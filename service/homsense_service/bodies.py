"""Request bodies: bounded, and unfolded when they come gzipped. Pure ASGI."""

import zlib

from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from homsense_service.problems import MALFORMED_GZIP, MEDIA_TYPE, TOO_LARGE, Kind, problem

_GZIP = 16 + zlib.MAX_WBITS


class BoundedBodies:
    """Middleware that reads each body whole, refuses large ones and unfolds gzip.

    Parameters
    ----------
    app : ASGI application
        What handles the request.
    max_bytes : int
        Largest body, before and after unfolding.
    """

    def __init__(self, app: ASGIApp, max_bytes: int) -> None:
        self._app = app
        self._max_bytes = max_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        body = await _read(receive, self._max_bytes)
        if body is None:
            refusal = _refusal(TOO_LARGE, f"the limit is {self._max_bytes} bytes")
            await refusal(scope, receive, send)
            return
        if dict(scope["headers"]).get(b"content-encoding", b"").lower() == b"gzip":
            unfolded = _unfold(body, self._max_bytes)
            if isinstance(unfolded, Kind):
                refusal = _refusal(unfolded, f"the limit is {self._max_bytes} bytes unfolded")
                await refusal(scope, receive, send)
                return
            body, scope = unfolded, _without_encoding(scope, len(unfolded))
        await self._app(scope, _once(body, receive), send)


async def _read(receive: Receive, limit: int) -> bytes | None:
    body = bytearray()
    while True:
        message = await receive()
        body += message.get("body", b"")
        if len(body) > limit:
            return None
        if not message.get("more_body", False):
            return bytes(body)


def _unfold(body: bytes, limit: int) -> bytes | Kind:
    unfolding = zlib.decompressobj(_GZIP)
    try:
        unfolded = unfolding.decompress(body, limit)
    except zlib.error:
        return MALFORMED_GZIP
    if unfolding.unconsumed_tail:
        return TOO_LARGE
    complete = unfolding.eof and not unfolding.unused_data
    return unfolded if complete else MALFORMED_GZIP


def _without_encoding(scope: Scope, length: int) -> Scope:
    replaced = (b"content-encoding", b"content-length")
    kept = [(name, value) for name, value in scope["headers"] if name not in replaced]
    return {**scope, "headers": [*kept, (b"content-length", str(length).encode())]}


def _once(body: bytes, receive: Receive) -> Receive:
    """Return a channel that gives the body, then what really comes."""
    messages: list[Message] = [{"type": "http.request", "body": body, "more_body": False}]

    async def replay() -> Message:
        return messages.pop() if messages else await receive()

    return replay


def _refusal(kind: Kind, detail: str) -> JSONResponse:
    return JSONResponse(problem(kind, detail), status_code=kind.status, media_type=MEDIA_TYPE)
