"""Request bodies that come gzipped, with a cap on what they may unfold to. Pure ASGI."""

import json
import zlib

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from homsense_service.problems import MALFORMED_GZIP, TOO_LARGE, Kind, problem

_GZIP = 16 + zlib.MAX_WBITS


class GzipRequests:
    """Middleware that unfolds bodies with ``Content-Encoding: gzip``.

    Parameters
    ----------
    app : ASGI application
        What handles the request.
    max_bytes : int
        Largest body, before and after.
    """

    def __init__(self, app: ASGIApp, max_bytes: int) -> None:
        self._app = app
        self._max_bytes = max_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        headers = dict(scope.get("headers", ()))
        if scope["type"] != "http" or headers.get(b"content-encoding", b"").lower() != b"gzip":
            await self._app(scope, receive, send)
            return
        folded = await _read(receive, self._max_bytes)
        if folded is None:
            await _refuse(send, TOO_LARGE, f"the limit is {self._max_bytes} bytes")
            return
        unfolding = zlib.decompressobj(_GZIP)
        try:
            body = unfolding.decompress(folded, self._max_bytes)
        except zlib.error:
            await _refuse(send, MALFORMED_GZIP, "the body does not unfold")
            return
        if unfolding.unconsumed_tail:
            await _refuse(send, TOO_LARGE, f"the limit is {self._max_bytes} bytes unfolded")
            return
        if not unfolding.eof or unfolding.unused_data:
            await _refuse(send, MALFORMED_GZIP, "the body is cut short or goes on behind its end")
            return
        kept = [
            (name, value)
            for name, value in scope["headers"]
            if name not in (b"content-encoding", b"content-length")
        ]
        kept.append((b"content-length", str(len(body)).encode()))
        await self._app({**scope, "headers": kept}, _once(body, receive), send)


async def _read(receive: Receive, limit: int) -> bytes | None:
    body = bytearray()
    while True:
        message = await receive()
        body += message.get("body", b"")
        if len(body) > limit:
            return None
        if not message.get("more_body", False):
            return bytes(body)


def _once(body: bytes, receive: Receive) -> Receive:
    """Return a channel that gives the body, then what really comes."""
    messages: list[Message] = [{"type": "http.request", "body": body, "more_body": False}]

    async def replay() -> Message:
        return messages.pop() if messages else await receive()

    return replay


async def _refuse(send: Send, kind: Kind, detail: str) -> None:
    body = json.dumps(problem(kind, detail)).encode()
    headers = [
        (b"content-type", b"application/problem+json"),
        (b"content-length", str(len(body)).encode()),
    ]
    await send({"type": "http.response.start", "status": kind.status, "headers": headers})
    await send({"type": "http.response.body", "body": body})
