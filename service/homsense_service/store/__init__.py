"""Where all that is acknowledged survives: sites, maps, scans, sessions and keys."""

from homsense_service.store.contract import Artifacts, Committed, Store
from homsense_service.store.sqlite import SqliteStore

__all__ = ["Artifacts", "Committed", "SqliteStore", "Store"]
