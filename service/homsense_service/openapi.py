"""Write the OpenAPI document: ``python -m homsense_service.openapi FILE``."""

import json
import sys
from pathlib import Path

from homsense_service.app import create_app
from homsense_service.settings import Settings


def openapi_text() -> str:
    """Return the document with sorted keys."""
    app = create_app(Settings())
    return json.dumps(app.openapi(), indent=1, sort_keys=True) + "\n"


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(openapi_text())
