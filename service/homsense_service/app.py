"""The composition root: settings -> application."""

import asyncio
import logging
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, closing
from importlib.metadata import version
from pathlib import Path
from typing import Any

import zenoh
from anyio import to_thread
from fastapi import FastAPI
from starlette.concurrency import run_in_threadpool
from starlette.middleware.cors import CORSMiddleware

from homsense_service import answers
from homsense_service.bodies import BoundedBodies
from homsense_service.bridge.bridge import Bridge, House
from homsense_service.bridge.joining import Joining
from homsense_service.bridge.transport import is_wanted, opened
from homsense_service.errors import ServiceError
from homsense_service.keys import KeyRing
from homsense_service.limiting import BoundedConcurrency, RateLimit
from homsense_service.manners import Manners
from homsense_service.metrics import Metrics, TimedRequests
from homsense_service.operations import Operations
from homsense_service.ros2.mapping import read_mapping
from homsense_service.ros2.robots import Robot
from homsense_service.routes import (
    expectations,
    health,
    keys,
    live,
    registrations,
    scans,
    sessions,
    sites,
)
from homsense_service.schemas import Problem
from homsense_service.settings import Settings
from homsense_service.sites import SiteRegistry
from homsense_service.store import SqliteStore, Store
from homsense_service.streams import Streams
from homsense_service.warming import Warming

TIDY_EVERY_S = 20.0
ROBOT_IDS = 10
ALLOWED_HEADERS = [
    "authorization", "content-type", "idempotency-key", "if-match", "if-none-match",
]  # fmt: skip

_log = logging.getLogger(__name__)


class _Described(FastAPI):
    """Its OpenAPI document tells of problems, too, which no route returns."""

    def openapi(self) -> dict[str, Any]:
        """Return the document, made when it is first asked for."""
        if self.openapi_schema is None:
            schema = Problem.model_json_schema(ref_template="#/components/schemas/{model}")
            parts = schema.pop("$defs")
            super().openapi()["components"]["schemas"].update({"Problem": schema, **parts})
        return super().openapi()


def create_app(
    settings: Settings | None = None,
    open_store: Callable[[Path], Store] = SqliteStore,
    open_network: Callable[[Settings], zenoh.Session] = opened,
) -> FastAPI:
    """Return the application.

    Parameters
    ----------
    settings : Settings, optional
        Read from the environment when absent.
    open_store : callable, optional
        Opens the store in the data directory.
    open_network : callable, optional
        Joins the zenoh network.

    Returns
    -------
    FastAPI
        Opens the store when it starts and closes it when it stops.
    """
    chosen = settings or Settings()

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        # Each request that may wait has a thread, so that those who wait hold up nobody else.
        threads = to_thread.current_default_thread_limiter()
        threads.total_tokens += chosen.max_pending_requests
        with closing(open_store(chosen.data)) as store:
            if store.caution:
                _log.warning(store.caution)
            app.state.warming = warming = Warming(chosen.engine)
            with closing(
                SiteRegistry(store, chosen, warming.engine, time.time, warming.backend)
            ) as registry:
                operations = Operations(registry, store, chosen, time.time, warming.backend)
                app.state.operations = operations
                app.state.keys = KeyRing(store.api_keys())
                app.state.rate_limit = RateLimit(chosen.requests_per_minute)
                streams = Streams(chosen.max_readers)
                metrics = Metrics(
                    lambda: len(registry.all()),
                    lambda: len(operations.sessions),
                    lambda: len(streams),
                )
                operations.watch = registry.watch = metrics.watch
                store.watch(metrics.committed)
                app.state.metrics, app.state.streams = metrics, streams
                tidying = asyncio.create_task(_tidy(operations, streams))
                house = House(operations, app.state.keys, app.state.rate_limit, streams, metrics)
                async with _on_network(chosen, house, open_network) as app.state.joining:
                    yield
                tidying.cancel()

    app = _Described(
        title="homsense",
        version=version("homsense"),
        summary="Localization without survey, GPS or labels, by homological sensing.",
        license_info={"name": "Apache-2.0", "identifier": "Apache-2.0"},
        lifespan=lifespan,
        telemetry={
            "auto_configure": chosen.telemetry,
            "operation_spans": False,
            "logs": False,
        },
    )
    answers.install(app)
    app.add_middleware(TimedRequests)
    app.add_middleware(BoundedBodies, max_bytes=chosen.max_body_bytes)
    app.add_middleware(BoundedConcurrency, most=chosen.max_pending_requests)
    if chosen.cors_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=chosen.cors_origins,
            allow_methods=["*"],
            allow_headers=ALLOWED_HEADERS,
            expose_headers=["etag", "retry-after", "x-request-id"],
        )
    app.add_middleware(Manners)
    # A request tries them in this order: what is asked most comes first.
    for module in (sessions, scans, live, sites, expectations, registrations, keys, health):
        app.include_router(module.router)
    return app


@asynccontextmanager
async def _on_network(
    settings: Settings, house: House, open_network: Callable[[Settings], zenoh.Session]
) -> AsyncIterator[Joining | None]:
    """Serve devices over zenoh, too, if that is wanted; a router may come later."""
    if not is_wanted(settings):
        yield None
        return
    mapping = None if settings.ros2_mapping is None else read_mapping(settings.ros2_mapping)

    def bridged(network: zenoh.Session) -> Bridge:
        bridge = Bridge(network, house, settings)
        if mapping is not None:
            for number, row in enumerate(mapping.robots):
                Robot(row, mapping.graph, network, bridge, ROBOT_IDS * number)
        return bridge

    joining = Joining(lambda: open_network(settings), bridged)
    try:
        yield joining
    finally:
        await joining.close()


async def _tidy(operations: Operations, streams: Streams) -> None:
    """Look after idle sessions now and then."""
    while True:
        await asyncio.sleep(TIDY_EVERY_S)
        try:
            for session in await run_in_threadpool(operations.tidy):
                streams.end(session)
        except ServiceError:
            _log.exception("old scans or idle sessions could not be forgotten")
