"""What an operator watches, in the words of Prometheus. Pure ASGI, one registry an application."""

import time
from collections.abc import Callable
from contextlib import AbstractContextManager

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest
from starlette.types import ASGIApp, Message, Receive, Scope, Send


class Metrics:
    """Counters of the service.

    Parameters
    ----------
    sites, sessions, readers : callable
        Tell how many there are now.
    """

    def __init__(
        self,
        sites: Callable[[], float],
        sessions: Callable[[], float],
        readers: Callable[[], float],
    ) -> None:
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
        self.dropped = Counter(
            "homsense_scans_dropped",
            "Scans that were not taken, by the member that was wrong.",
            ["reason"],
            registry=self._registry,
        )
        self.commits = Histogram(
            "homsense_commit_seconds",
            "Time to write and synchronize one transaction.",
            registry=self._registry,
        )
        self.commit_jobs = Histogram(
            "homsense_commit_jobs",
            "Requests that shared one transaction.",
            buckets=[1, 2, 4, 8, 16, 32, 64, 128, 256, 512],
            registry=self._registry,
        )
        self.stages = Histogram(
            "homsense_stage_seconds",
            "Time of a stage: measure (a scan), filter (a step), step (all of a request with "
            "steps, until they are on disk), absorb (scans into the complex).",
            ["stage"],
            buckets=[1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1, 3],
            registry=self._registry,
        )
        self.inputs = Counter(
            "homsense_device_inputs",
            "Messages of devices over zenoh, by kind.",
            ["kind"],
            registry=self._registry,
        )
        self.lost_inputs = Counter(
            "homsense_device_inputs_lost",
            "Motions and scans that never came, by their numbers.",
            registry=self._registry,
        )
        self.refused = Counter(
            "homsense_device_messages_refused",
            "Messages over zenoh that were not taken, by code.",
            ["code"],
            registry=self._registry,
        )
        self.devices = Gauge(
            "homsense_devices",
            "That stream over zenoh, by state.",
            ["state"],
            registry=self._registry,
        )
        self.pending = 0
        Gauge(
            "homsense_pending_requests",
            "Requests that wait for their answers.",
            registry=self._registry,
        ).set_function(lambda: self.pending)
        Gauge("homsense_readers", "Of live poses.", registry=self._registry).set_function(readers)
        Gauge("homsense_sites", "Sites.", registry=self._registry).set_function(sites)
        Gauge("homsense_sessions", "Live sessions.", registry=self._registry).set_function(
            sessions
        )

    def committed(self, seconds: float, jobs: int) -> None:
        """Take note of a transaction."""
        self.commits.observe(seconds)
        self.commit_jobs.observe(jobs)

    def watch(self, stage: str) -> AbstractContextManager[object]:
        """Return a context whose time is that of a stage."""
        return self.stages.labels(stage).time()

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
        metrics: Metrics = scope["app"].state.metrics
        is_waiting = True

        async def watched(message: Message) -> None:
            nonlocal status, is_waiting
            if message["type"] == "http.response.start":
                status = message["status"]
                metrics.pending -= is_waiting
                is_waiting = False
            await send(message)

        started = time.perf_counter()
        metrics.pending += 1
        try:
            await self._app(scope, receive, watched)
        finally:
            metrics.pending -= is_waiting
            route = getattr(scope.get("route"), "path", "none")
            metrics.requests.labels(scope["method"], route, str(status)).observe(
                time.perf_counter() - started
            )
