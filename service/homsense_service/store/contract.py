"""What the service asks of a store."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Protocol

from homsense_service.records import (
    Binding,
    Checkpoint,
    Event,
    KeyRecord,
    NumberedScan,
    SessionRecord,
    SiteRecord,
    Snapshot,
    StoredScan,
)

Committed = Callable[[list[NumberedScan]], None]
"""Is told the scans that are new and on disk."""

Artifacts = Mapping[str, Callable[[], bytes]]
"""How artifacts are written, by digest; asked only for those that the store does not have."""


class Store(Protocol):
    """A method that changes something returns when that is durable.

    All raise `StoreError` when the store cannot be used, and then nothing has changed.
    """

    def sites(self) -> dict[str, SiteRecord]:
        """Return all sites by name."""
        ...

    def put_site(self, site: str, record: SiteRecord) -> None:
        """Create a site or replace its configuration."""
        ...

    def delete_site(self, site: str) -> None:
        """Delete a site with its map, scans and sessions."""
        ...

    def map_document(self, site: str) -> dict[str, Any] | None:
        """Return a site's map."""
        ...

    def put_map(self, site: str, document: dict[str, Any], revision: int) -> None:
        """Replace a site's map; the site gets a new revision."""
        ...

    def add_scans(
        self, site: str, scans: Sequence[StoredScan], committed: Committed
    ) -> list[bool]:
        """Append scans; tell for each whether it was new.

        `committed` is told the new ones, in the order of the log: a batch that comes earlier in
        the log is told earlier.
        """
        ...

    def scans(self, site: str, after: int = 0) -> Iterator[NumberedScan]:
        """Yield a site's scans in the order of the log, from behind a number."""
        ...

    def even_scans(self, site: str, most: int) -> list[StoredScan]:
        """Return at most so many scans of a site, evenly over the log; all when they are few."""
        ...

    def latest_scans(self, site: str, most: int) -> list[StoredScan]:
        """Return at most so many scans of a site, the last of the log."""
        ...

    def delete_scans(self, site: str, device: str) -> int:
        """Delete the scans of a device, and the names of landmarks that nobody else heard."""
        ...

    def expire_scans(self, site: str, before_s: float) -> int:
        """Delete the scans that were observed before a moment, Unix seconds."""
        ...

    def checkpoint(self, site: str) -> Checkpoint | None:
        """Return what a site was when its last checkpoint was made."""
        ...

    def put_checkpoint(self, site: str, checkpoint: Checkpoint) -> None:
        """Replace a site's checkpoint."""
        ...

    def sessions(self) -> list[SessionRecord]:
        """Return all sessions that were not closed."""
        ...

    def open_session(self, record: SessionRecord, artifacts: Artifacts) -> None:
        """Keep a session with what it refers to."""
        ...

    def close_session(self, session: str) -> None:
        """Delete a session, its journal, and artifacts that no other session refers to."""
        ...

    def journal(
        self,
        session: str,
        events: Sequence[Event],
        *,
        scans: tuple[str, Sequence[StoredScan], Committed] | None = None,
        artifacts: Artifacts | None = None,
    ) -> None:
        """Append events to a session and, in the same transaction, scans to a site."""
        ...

    def events(self, session: str, after: int = 0) -> Iterator[Event]:
        """Yield the events of a session from behind a number."""
        ...

    def moves(self, session: str) -> list[Event]:
        """Return the events of a session that are moves to other maps."""
        ...

    def fingerprints(self, session: str, first: int, last: int) -> dict[int, bytes]:
        """Return by which content the steps of a range of sequence numbers are known."""
        ...

    def step(self, session: str, seq: int) -> Event | None:
        """Return the event of a step, if it was taken."""
        ...

    def bindings(self) -> list[Binding]:
        """Return which devices stream into which sessions."""
        ...

    def bind(self, binding: Binding) -> None:
        """Let a device stream into a session, and no longer into another."""
        ...

    def snapshots(self, session: str) -> list[Snapshot]:
        """Return the snapshots that are kept, the latest first."""
        ...

    def put_snapshot(self, session: str, snapshot: Snapshot) -> None:
        """Keep a snapshot some time soon, when the store has nothing more urgent to do."""
        ...

    def artifact(self, digest: str) -> bytes:
        """Return what a session refers to."""
        ...

    def api_keys(self) -> list[KeyRecord]:
        """Return all keys."""
        ...

    def add_key(self, record: KeyRecord) -> None:
        """Keep a key or raise `KeyExistsError`."""
        ...

    def delete_key(self, name: str) -> None:
        """Delete a key or raise `KeyNotFoundError`."""
        ...

    @property
    def caution(self) -> str | None:
        """What an operator should know about it, if anything."""
        ...

    def watch(self, on_commit: Callable[[float, int], None]) -> None:
        """Tell from now on how long each transaction took, seconds, and how many jobs it had."""
        ...

    def check(self) -> None:
        """Raise `StoreError` when the store does not answer."""
        ...

    def damage(self) -> list[str]:
        """Return what is wrong with the files of the store; reads all of them."""
        ...

    def age_s(self) -> float:
        """Return how long the oldest work waits to be written, seconds; 0 when none waits."""
        ...

    def close(self) -> None:
        """Write what waits and release the data directory."""
        ...
