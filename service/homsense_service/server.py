"""Run the application until a signal comes."""

import uvicorn

from homsense_service.app import create_app
from homsense_service.settings import Settings


def serve(settings: Settings) -> None:
    """Serve until SIGINT or SIGTERM.

    Parameters
    ----------
    settings : Settings
        Where to listen and where the data is.
    """
    uvicorn.run(
        create_app(settings),
        host=settings.host,
        port=settings.port,
        log_level="warning",
        timeout_graceful_shutdown=3,
    )
