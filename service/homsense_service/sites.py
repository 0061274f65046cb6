"""All sites of the process, around a store."""

import math
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from typing import Any

import homsense
from homsense.backend import Backend, fastest
from homsense.engine import Engine
from homsense.registered.registration import COMPASS_RAD
from homsense_service.background import Builder
from homsense_service.checkpoints import checkpoint_key, from_bytes, sensing, to_bytes
from homsense_service.errors import SiteNotFoundError
from homsense_service.records import Checkpoint, SiteConfig, SiteRecord, StoredScan
from homsense_service.registering import CrowdQuestion, Registered, walk_scan
from homsense_service.revisions import Expected, check, whatever
from homsense_service.settings import Settings
from homsense_service.site import Site
from homsense_service.store import Store
from homsense_service.versions import ComplexVersion, MapVersion, WitnessCheck
from homsense_service.watching import Watch, unwatched

_LEAST_TAIL, _LONGEST_TAIL = 2000, 20_000
_CHUNK = 5000


def check_size(document: object, most: int) -> None:
    """Raise `homsense.InvalidMapError` when a document has too many positions."""
    waiting, positions = [document], 0
    while waiting:
        entry = waiting.pop()
        if isinstance(entry, dict):
            waiting.extend(entry.values())
        elif isinstance(entry, list):
            positions += not any(isinstance(inside, (list, dict)) for inside in entry)
            waiting.extend(inside for inside in entry if isinstance(inside, (list, dict)))
        if positions > most:
            message = f"a map may have {most} positions at most"
            raise homsense.InvalidMapError(message)


class SiteRegistry:
    """All sites of this process, loaded from the store at the start.

    Parameters
    ----------
    store : Store
        Where they survive.
    settings : Settings
        Limits and resolutions.
    engine : callable
        Returns what runs the hot loops.
    clock : callable
        Returns Unix seconds.
    backend : callable, optional
        Returns what runs the filter.
    """

    def __init__(
        self,
        store: Store,
        settings: Settings,
        engine: Callable[[], Engine],
        clock: Callable[[], float],
        backend: Callable[[], Backend] = fastest,
    ) -> None:
        self._store = store
        self._clock = clock
        self._settings = settings
        self._engine = engine
        self._builder = Builder(engine, backend, max(1, settings.max_pending_requests // 2))
        self.watch: Watch = unwatched
        self._lock = threading.Lock()
        self._checkpointed: dict[str, int] = {}
        self._expired: dict[str, float] = {}
        self._sites = {name: self._load(name, record) for name, record in store.sites().items()}

    def all(self) -> list[Site]:
        """Return the sites by name."""
        return [self._sites[name] for name in sorted(self._sites)]

    def get(self, name: str) -> Site:
        """Return a site or raise `SiteNotFoundError`."""
        try:
            return self._sites[name]
        except KeyError:
            raise SiteNotFoundError(name) from None

    def close(self) -> None:
        """Stop what goes on in the background."""
        self._builder.close()

    def put(
        self, name: str, config: SiteConfig, expected: Expected = whatever
    ) -> tuple[Site, bool]:
        """Create or reconfigure a site, if its revision is an expected one; tell if it is new."""
        with self._lock:
            site = self._sites.get(name)
            check(None if site is None else str(site.revision), expected)
            if site is None:
                self._store.put_site(name, SiteRecord(config))
                self._sites[name] = site = self._new(name, SiteRecord(config))
                return site, True
        with site.replacing:
            check(str(site.revision), expected)
            before = site.config
            built = self._built(site, config) if sensing(before) != sensing(config) else None
            with site.writing:
                with self._lock:  # somebody may have put a map meanwhile, or deleted the site
                    if self.get(name) is not site:
                        raise SiteNotFoundError(name)
                    check(str(site.revision), expected)
                    self._store.put_site(name, SiteRecord(config, site.revision + 1))
                if built is not None:
                    self._replace(site, built)
                site.config = config
                site.revision += 1
                if site.map is not None and before.origin != config.origin:
                    site.map = self.read_map(site.map.document, config)
        return site, False

    def delete(self, name: str, expected: Expected = whatever) -> None:
        """Delete a site with everything that belongs to it."""
        with self._lock:
            check(str(self.get(name).revision), expected)
            self._store.delete_site(name)
            del self._sites[name]

    def put_map(
        self, site: Site, document: dict[str, Any], expected: Expected = whatever
    ) -> MapVersion:
        """Replace a site's map once it is known to be sound."""
        check_size(document, self._settings.max_map_positions)
        version = self.read_map(document, site.config)
        with site.writing:
            check(None if site.map is None else site.map.digest, expected)
            self._store.put_map(site.name, document, site.revision + 1)
            site.map = version
            site.revision += 1
        return version

    def placed(self, site: Site) -> Registered | None:
        """Return the crowd on the map, however old; begin to place it when enough has a track."""
        if site.tracked < self._settings.registration_scans:
            return None
        return site.registering.at_hand(self.crowd(site))

    def add_scans(
        self, site: Site, scans: Sequence[StoredScan]
    ) -> tuple[list[bool], ComplexVersion]:
        """Log scans, then join the new ones into the complex."""
        fresh = self._store.add_scans(site.name, scans, site.receive)
        return fresh, self.catch_up(site)

    def catch_up(self, site: Site) -> ComplexVersion:
        """Join the scans that are on disk into the complex, and learn from it when it is time."""
        with site.writing, self.watch("absorb"):
            version = site.catch_up(self._clock())
        if site.map is not None and site.expecting.current is not None:
            site.expecting.refresh(site.question())
        if site.map is not None and site.registering.current is not None:
            site.registering.refresh(self.crowd(site))
        if self._is_due(site):
            self._checkpointed[site.name] = version.number
            self._builder.submit(self.keep_checkpoint, site)
        return version

    def delete_device(self, site: Site, device: str) -> int:
        """Delete the scans of a device and build the complex from the others."""
        with site.replacing:
            deleted = self._store.delete_scans(site.name, device)
            if deleted:
                with site.writing:
                    site.catch_up(self._clock())
                self._rebuild(site)
        return deleted

    def expire(self) -> None:
        """Forget the scans that are older than all epochs that count, in the logs too."""
        for site in self.all():
            first_s = self._first_that_counts_s(site)
            if first_s is None or first_s == self._expired.get(site.name):
                continue
            with site.writing:
                site.catch_up(self._clock())
            if self._store.expire_scans(site.name, first_s):
                self.keep_checkpoint(site)
            self._expired[site.name] = first_s

    def _first_that_counts_s(self, site: Site) -> float | None:
        """Return when the first epoch that still counts began; None where all count."""
        if site.config.retention is None:
            return None
        length_s, count = site.config.retention
        return (self._clock() // length_s + 1 - count) * length_s

    def keep_checkpoint(self, site: Site) -> None:
        """Keep what a site has made of its scans so far."""
        with site.replacing:
            with site.writing:
                digested, through, config = site.digested(), site.through, site.config
            key = checkpoint_key(config, self._settings.calibration_scans)
            self._store.put_checkpoint(site.name, Checkpoint(through, key, to_bytes(digested)))

    def _is_due(self, site: Site) -> bool:
        """Tell whether the end of the log has become so long that a start would be slow."""
        kept, now = self._checkpointed.get(site.name, 0), site.complex.number
        return now - kept >= min(max(_LEAST_TAIL, kept // 4), _LONGEST_TAIL)

    def crowd(self, site: Site) -> CrowdQuestion:
        """Return what the registration of a site depends on now."""
        version, config = site.require_map(), site.config
        return CrowdQuestion(
            version,
            site.reachable(version),
            site.tracked,
            lambda: self._walks(site),
            COMPASS_RAD if config.track_headings == "east" else None,
            (config.landmark_key, config.track_headings, config.wall_tolerance_m),
        )

    def _walks(self, site: Site) -> Iterator[homsense.WalkScan]:
        for _, scan in self._store.scans(site.name):
            if (walked := walk_scan(scan, site.readings(scan.readings))) is not None:
                yield walked

    def some_scans(self, site: Site) -> tuple[list[StoredScan], list[StoredScan]]:
        """Return scans of a site evenly over the log, and the latest; all when they are few."""
        most = self._settings.calibration_scans
        return self._store.even_scans(site.name, most), self._store.latest_scans(site.name, most)

    def checked_scans(self, site: Site) -> list[StoredScan]:
        """Return the scans that the self-checks look at, evenly over the log."""
        return self._store.even_scans(site.name, self._settings.check_scans)

    def range_curve(
        self, site: Site, scans: Iterable[StoredScan], *, most_in_view: float = math.inf
    ) -> list[homsense.RangePoint]:
        """Return the range self-check over some scans of a site."""
        return homsense.range_curve(
            (site.readings(scan.readings) for scan in scans),
            max_age_s=site.config.max_age_s,
            most_in_view=most_in_view,
            engine=self._engine(),
        )

    def witness_curve(self, site: Site, scans: Iterable[StoredScan]) -> WitnessCheck:
        """Return the witness check over some scans of a site."""
        seen = [(scan.device, site.visible(scan.readings)) for scan in scans]
        median = homsense.median_witnesses(seen)
        return WitnessCheck(median, homsense.witness_curve(seen, engine=self._engine()))

    def read_map(self, document: dict[str, Any], config: SiteConfig) -> MapVersion:
        """Return the version that a document describes, without storing it."""
        return MapVersion.read(document, config.origin, self._settings.cell_m)

    def _new(self, name: str, record: SiteRecord) -> Site:
        site = Site(name, record.config, self._settings, self._engine, self._builder)
        site.revision = record.revision
        return site

    def _load(self, name: str, record: SiteRecord) -> Site:
        site = self._new(name, record)
        document = self._store.map_document(name)
        if document is not None:
            site.map = self.read_map(document, record.config)
        kept = self._store.checkpoint(name)
        if kept is not None and kept.key == checkpoint_key(
            record.config, self._settings.calibration_scans
        ):
            site.resume(from_bytes(kept.body, 1, self._engine()), kept.through)
            self._checkpointed[name] = site.complex.number
        self._read_on(site)
        return site

    def rebuild(self, site: Site) -> None:
        """Build what a site makes of its scans again, from the log alone."""
        with site.replacing:
            self._rebuild(site)

    def _rebuild(self, site: Site) -> None:
        built = self._built(site, site.config)
        with site.writing:
            self._replace(site, built)

    def _built(self, site: Site, config: SiteConfig) -> Site:
        """Return what a site would be under a configuration, but for the latest scans.

        The site itself goes on meanwhile.
        """
        built = self._new(site.name, SiteRecord(config))
        while self._read_on(built) > _CHUNK:
            pass
        return built

    def _replace(self, site: Site, built: Site) -> None:
        """Let a site go on as it was built again; the caller holds `writing`."""
        self._read_on(built)
        site.take_over(built)
        self._checkpointed.pop(site.name, None)

    def _read_on(self, site: Site) -> int:
        """Join what the log has behind the last scan that was taken in; return how many."""
        count, log = 0, self._store.scans(site.name, site.through)
        while chunk := list(islice(log, _CHUNK)):
            site.take_in(chunk, self._clock())
            count += len(chunk)
        site.take_in((), self._clock())
        return count
