"""Not more requests than the service can do: at once, and in a minute."""

import math
import time

from limits import RateLimitItemPerMinute
from limits.storage import MemoryStorage
from limits.strategies import SlidingWindowCounterRateLimiter
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from homsense_service.answers import refusal
from homsense_service.errors import OverloadError, RateLimitError

_EXEMPT = frozenset({"/healthz", "/readyz", "/metrics"})


class RateLimit:
    """How many requests each key, or each address without keys, may send in a minute.

    Parameters
    ----------
    per_minute : int
        0 sets no limit.
    """

    def __init__(self, per_minute: int) -> None:
        self._limit = RateLimitItemPerMinute(per_minute) if per_minute else None
        self._limiter = SlidingWindowCounterRateLimiter(MemoryStorage())

    def hit(self, who: str) -> None:
        """Count a request.

        Parameters
        ----------
        who : str
            Whom it counts for.

        Raises
        ------
        RateLimitError
            If there were too many.
        """
        if self._limit is None or self._limiter.hit(self._limit, who):
            return
        window = self._limiter.get_window_stats(self._limit, who)
        message = f"more than {self._limit.amount} requests a minute"
        raise RateLimitError(message, max(1, math.ceil(window.reset_time - time.time())))


class BoundedConcurrency:
    """Middleware that refuses requests while too many wait for their answers.

    Parameters
    ----------
    app : ASGI application
        What handles the request.
    most : int
        How many may wait.
    """

    def __init__(self, app: ASGIApp, most: int) -> None:
        self._app, self._most, self._waiting = app, most, 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request; a stream counts until it begins."""
        if scope["type"] != "http" or scope["path"] in _EXEMPT:
            await self._app(scope, receive, send)
            return
        if self._waiting >= self._most:
            error = OverloadError(f"{self._most} requests wait already")
            await refusal(error)(scope, receive, send)
            return
        self._waiting += 1
        counted = True

        async def watched(message: Message) -> None:
            nonlocal counted
            if counted and message["type"] == "http.response.start":
                self._waiting -= 1
                counted = False
            await send(message)

        try:
            await self._app(scope, receive, watched)
        finally:
            if counted:
                self._waiting -= 1
