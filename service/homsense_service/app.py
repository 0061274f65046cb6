"""The composition root: settings -> application."""

import logging
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, closing
from importlib.metadata import version
from pathlib import Path

from fastapi import FastAPI

from homsense_service import answers
from homsense_service.bodies import BoundedBodies
from homsense_service.metrics import Metrics, TimedRequests
from homsense_service.operations import Operations
from homsense_service.routes import expectations, health, registrations, scans, sessions, sites
from homsense_service.schemas import Problem
from homsense_service.settings import Settings
from homsense_service.sites import SiteRegistry
from homsense_service.store import SqliteStore, Store
from homsense_service.warming import Warming

_log = logging.getLogger(__name__)


def create_app(
    settings: Settings | None = None, open_store: Callable[[Path], Store] = SqliteStore
) -> FastAPI:
    """Return the application.

    Parameters
    ----------
    settings : Settings, optional
        Read from the environment when absent.
    open_store : callable, optional
        Opens the store in the data directory.

    Returns
    -------
    FastAPI
        Opens the store when it starts and closes it when it stops.
    """
    chosen = settings or Settings()

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        with closing(open_store(chosen.data)) as store:
            if store.caution:
                _log.warning(store.caution)
            warming = Warming(chosen.engine)
            with closing(SiteRegistry(store, chosen, warming.engine, time.time)) as registry:
                operations = Operations(registry, store, chosen, time.time, warming.backend)
                app.state.operations, app.state.store = operations, store
                app.state.metrics = Metrics(
                    lambda: len(registry.all()), lambda: len(operations.sessions)
                )
                yield

    app = FastAPI(
        title="homsense",
        version=version("homsense"),
        summary="Localization without survey, GPS or labels, by homological sensing.",
        license_info={"name": "Apache-2.0", "identifier": "Apache-2.0"},
        lifespan=lifespan,
    )
    answers.install(app)
    app.add_middleware(TimedRequests)
    app.add_middleware(BoundedBodies, max_bytes=chosen.max_body_bytes)
    for module in (health, sites, expectations, registrations, scans, sessions):
        app.include_router(module.router)
    _describe_problems(app)
    return app


def _describe_problems(app: FastAPI) -> None:
    """Add the schema of problems, which no route returns, to the OpenAPI document."""
    schema = Problem.model_json_schema(ref_template="#/components/schemas/{model}")
    parts = schema.pop("$defs")
    app.openapi()["components"]["schemas"].update({"Problem": schema, **parts})
