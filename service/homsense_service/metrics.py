"""What an operator watches, in the words of Prometheus. Pure ASGI, one registry an application."""

import time
from collections.abc import Callable

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest
from starlette.types import ASGIApp, Message, Receive, Scope, Send


class Metrics:
    """Counters of the service.

    Parameters
    ----------
    sites, sessions : callable
        Tell how many there are now.
    """

    def __init__(self, sites: Callable[[], float], sessions: Callable[[], float]) -> None:
        self._registry = CollectorRegistry()
        self.scans = Counter(
            "homsense_scans", "Scans posted, by result.", ["result"], registry=self._registry
        )
        self.steps = Counter("homsense_steps", "Steps posted.", registry=self._registry)
        self.requests = Histogram(
            "homsense_request_seconds",
            "Time to answer, by method, route and status.",
            ["method", "route", "status"],
            registry=self._registry,
        )
        Gauge("homsense_sites", "Sites.", registry=self._registry).set_function(sites)
        Gauge("homsense_sessions", "Live sessions.", registry=self._registry).set_function(
            sessions
        )

    def exposition(self) -> bytes:
        """Return all metrics in the text format of Prometheus."""
        return generate_latest(self._registry)


class TimedRequests:
    """Middleware that observes how long each request takes.

    Parameters
    ----------
    app : ASGI application
        What handles the request.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        status = 500

        async def watched(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
            await send(message)

        started = time.perf_counter()
        try:
            await self._app(scope, receive, watched)
        finally:
            route = getattr(scope.get("route"), "path", "none")
            metrics: Metrics = scope["app"].state.metrics
            metrics.requests.labels(scope["method"], route, str(status)).observe(
                time.perf_counter() - started
            )
