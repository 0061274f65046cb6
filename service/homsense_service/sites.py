"""All sites of the process, around a store."""

import math
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import homsense
from homsense.engine import Engine
from homsense.registered.registration import COMPASS_RAD
from homsense_service.background import Builder
from homsense_service.errors import SiteNotFoundError
from homsense_service.records import SiteConfig, StoredScan
from homsense_service.registering import CrowdQuestion, walk_scan
from homsense_service.settings import Settings
from homsense_service.site import Site
from homsense_service.store import Store
from homsense_service.versions import ComplexVersion, MapVersion, WitnessCheck


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
    """

    def __init__(
        self,
        store: Store,
        settings: Settings,
        engine: Callable[[], Engine],
        clock: Callable[[], float],
    ) -> None:
        self._store = store
        self._clock = clock
        self._settings = settings
        self._engine = engine
        self._builder = Builder(engine)
        self._lock = threading.Lock()
        self._sites = {name: self._load(name, config) for name, config in store.sites().items()}

    def all(self) -> list[Site]:
        """Return the sites by name."""
        return [self._sites[name] for name in sorted(self._sites)]

    def get(self, name: str) -> Site:
        """Return a site or raise `SiteNotFoundError`."""
        try:
            return self._sites[name]
        except KeyError:
            message = f"there is no site {name!r}"
            raise SiteNotFoundError(message) from None

    def close(self) -> None:
        """Stop what goes on in the background."""
        self._builder.close()

    def check_store(self) -> None:
        """Raise `StoreError` when the store does not answer."""
        self._store.sites()

    def put(self, name: str, config: SiteConfig) -> tuple[Site, bool]:
        """Create or reconfigure a site; tell whether it is new."""
        with self._lock:
            site = self._sites.get(name)
            self._store.put_site(name, config)
            if site is None:
                self._sites[name] = site = Site(
                    name, config, self._settings, self._engine, self._builder
                )
                return site, True
        with site.writing:
            before, site.config = site.config, config
            if _sees_differently(before, config):
                self._rebuild(site)
            if site.map is not None and before.origin != config.origin:
                site.map = self.read_map(site.map.document, config)
        return site, False

    def delete(self, name: str) -> None:
        """Delete a site with everything that belongs to it."""
        with self._lock:
            self.get(name)
            self._store.delete_site(name)
            del self._sites[name]

    def put_map(self, site: Site, document: dict[str, Any]) -> MapVersion:
        """Replace a site's map once it is known to be sound."""
        version = self.read_map(document, site.config)
        with site.writing:
            self._store.put_map(site.name, document)
            site.map = version
        return version

    def add_scans(
        self, site: Site, scans: Sequence[StoredScan]
    ) -> tuple[list[bool], ComplexVersion]:
        """Log scans, then join the new ones into the complex."""
        with site.writing:
            fresh = self._store.add_scans(site.name, scans)
            new = [scan for scan, is_new in zip(scans, fresh, strict=True) if is_new]
            version = site.absorb(new, self._clock())
        if site.map is not None and site.expecting.current is not None:
            site.expecting.refresh(site.question())
        if site.map is not None and site.registering.current is not None:
            site.registering.refresh(self.crowd(site))
        return fresh, version

    def crowd(self, site: Site) -> CrowdQuestion:
        """Return what the registration of a site depends on now."""
        version = site.require_map()
        return CrowdQuestion(
            version,
            site.reachable(version),
            site.tracked,
            lambda: self._walks(site),
            COMPASS_RAD if site.config.track_headings == "east" else None,
        )

    def _walks(self, site: Site) -> Iterator[homsense.WalkScan]:
        for scan in self._store.scans(site.name):
            if (walked := walk_scan(scan, site.readings(scan.readings))) is not None:
                yield walked

    def some_scans(self, site: Site) -> list[StoredScan]:
        """Return scans of a site, evenly over the log when there are many."""
        scans = list(self._store.scans(site.name))
        return scans[:: max(1, -(-len(scans) // self._settings.calibration_scans))]

    def range_curve(
        self,
        site: Site,
        scans: Iterable[StoredScan] | None = None,
        *,
        most_in_view: float = math.inf,
    ) -> list[homsense.RangePoint]:
        """Return the range self-check over some scans of a site, or over all."""
        chosen = self._store.scans(site.name) if scans is None else scans
        return homsense.range_curve(
            (site.readings(scan.readings) for scan in chosen),
            max_age_s=site.config.max_age_s,
            most_in_view=most_in_view,
            engine=self._engine(),
        )

    def witness_curve(self, site: Site) -> WitnessCheck:
        """Return the witness check over all scans of a site."""
        seen = [
            (scan.device, site.visible(scan.readings)) for scan in self._store.scans(site.name)
        ]
        median = homsense.median_witnesses(seen)
        return WitnessCheck(median, homsense.witness_curve(seen, engine=self._engine()))

    def read_map(self, document: dict[str, Any], config: SiteConfig) -> MapVersion:
        """Return the version that a document describes, without storing it."""
        site_map = homsense.SiteMap.from_geojson(document, origin=config.origin)
        free_space = homsense.FreeSpace.of(site_map, self._settings.cell_m)
        return MapVersion(document, site_map, free_space, site_map.digest())

    def _load(self, name: str, config: SiteConfig) -> Site:
        site = Site(name, config, self._settings, self._engine, self._builder)
        document = self._store.map_document(name)
        if document is not None:
            site.map = self.read_map(document, config)
        self._rebuild(site)
        return site

    def _rebuild(self, site: Site) -> None:
        site.forget()
        site.absorb(list(self._store.scans(site.name)), self._clock())


def _sees_differently(before: SiteConfig, after: SiteConfig) -> bool:
    def sensing(config: SiteConfig) -> tuple[object, ...]:
        return (
            config.landmark_key,
            config.min_rssi_dbm,
            config.max_age_s,
            config.quorum,
            config.quarantine,
            config.retention,
        )

    return sensing(before) != sensing(after)
