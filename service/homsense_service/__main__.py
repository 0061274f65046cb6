"""``python -m homsense_service``: serve with the settings of the environment."""

from homsense_service.server import serve
from homsense_service.settings import Settings

if __name__ == "__main__":
    serve(Settings())
