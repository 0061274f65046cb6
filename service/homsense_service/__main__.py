"""``python -m homsense_service``: serve with the settings of the environment."""

import sys

from homsense_service.server import main

if __name__ == "__main__":
    sys.exit(main())
