"""A site that is built again from its log goes on with what it has until the new is whole."""

import threading
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest
from homsense_service.errors import SiteNotFoundError
from homsense_service.records import (
    Checkpoint,
    NumberedScan,
    SiteConfig,
    StoredReading,
    StoredScan,
)
from homsense_service.settings import Settings
from homsense_service.site import Site
from homsense_service.sites import SiteRegistry
from homsense_service.store import SqliteStore

from homsense.engine import fastest

NOW_S = 1000.0


class Watched(SqliteStore):
    """A store that tells when its log is read and when a checkpoint is about to be put."""

    def __init__(self, directory: Path) -> None:
        super().__init__(directory)
        self.on_scan: Callable[[NumberedScan], None] = lambda _: None
        self.on_checkpoint: Callable[[], None] = lambda: None

    def scans(self, site: str, after: int = 0) -> Iterator[NumberedScan]:
        """Yield what the log has behind a number."""
        for scan in super().scans(site, after):
            self.on_scan(scan)
            yield scan

    def put_checkpoint(self, site: str, checkpoint: Checkpoint) -> None:
        """Replace a checkpoint."""
        self.on_checkpoint()
        super().put_checkpoint(site, checkpoint)


def scan(device: str, number: int) -> StoredScan:
    heard = (StoredReading(f"{device}{number}"), StoredReading(f"{device}{number + 1}"))
    return StoredScan(device, str(number), 0.0, heard)


def registry(store: SqliteStore) -> SiteRegistry:
    return SiteRegistry(store, Settings(), fastest, lambda: NOW_S)


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Watched]:
    with closing(Watched(tmp_path)) as opened:
        yield opened


@pytest.fixture
def sites(store: Watched) -> Iterator[SiteRegistry]:
    with closing(registry(store)) as opened:
        yield opened


@pytest.fixture
def yard(sites: SiteRegistry) -> Site:
    site, _ = sites.put("yard", SiteConfig())
    sites.add_scans(site, [scan(device, number) for device in "ab" for number in range(10)])
    return site


def landmarks(site: Site) -> frozenset[str]:
    return site.complex.landmark_complex.landmarks


def of(device: str, count: int = 11) -> set[str]:
    return {f"{device}{number}" for number in range(count)}


@pytest.mark.parametrize("change", ["device", "configuration", "nothing"])
def test_scans_join_and_readers_see_all_while_a_site_is_built_again(
    store: Watched, sites: SiteRegistry, yard: Site, change: str
) -> None:
    seen: list[frozenset[str]] = []

    def meanwhile(read: NumberedScan) -> None:
        seen.append(landmarks(yard))
        if read.scan.device != "late" and len(seen) % 5 == 0:
            assert not yard.writing.locked()
            sites.add_scans(yard, [scan("late", len(seen))])

    store.on_scan = meanwhile
    before = yard.complex
    if change == "device":
        assert sites.delete_device(yard, "b") == 10
    elif change == "configuration":
        sites.put("yard", SiteConfig(quorum=2))
    else:
        sites.rebuild(yard)
    late = frozenset(name for name in seen[-1] if name.startswith("late"))
    assert all(of("a") | of("b") <= one for one in seen)
    assert late
    assert yard.complex.generation > before.generation
    store.on_scan = lambda _: None
    everybody = of("a") | late if change == "device" else of("a") | of("b") | late
    assert yard.complex.raw.landmarks == everybody
    assert landmarks(yard) == (set() if change == "configuration" else everybody)
    sites.add_scans(yard, [scan("after", 0)])
    assert yard.complex.raw.landmarks == everybody | of("after", 2)
    assert yard.complex.number == 10 * (1 + (change != "device")) + len(late) // 2 + 1


def test_a_site_that_is_deleted_while_it_is_built_again_stays_deleted(
    store: Watched, sites: SiteRegistry, yard: Site
) -> None:
    def meanwhile(_: NumberedScan) -> None:
        store.on_scan = lambda _: None
        sites.delete(yard.name)

    store.on_scan = meanwhile
    with pytest.raises(SiteNotFoundError):
        sites.put(yard.name, SiteConfig(quorum=2))
    assert not sites.all()
    assert not store.sites()


def test_scans_that_wait_when_their_device_is_deleted_do_not_come_back(
    store: Watched, sites: SiteRegistry, yard: Site
) -> None:
    store.add_scans("yard", [scan("b", 20)], yard.receive)
    assert sites.delete_device(yard, "b") == 11
    sites.add_scans(yard, [scan("a", 10)])
    assert landmarks(yard) == of("a", 12)


def test_no_checkpoint_keeps_what_was_deleted(
    store: Watched, sites: SiteRegistry, yard: Site
) -> None:
    deleting = threading.Thread(target=sites.delete_device, args=(yard, "b"))

    def meanwhile() -> None:
        deleting.start()
        deleting.join(0.3)

    store.on_checkpoint = meanwhile
    sites.keep_checkpoint(yard)
    deleting.join()
    with closing(registry(store)) as again:
        assert landmarks(again.get("yard")) == landmarks(yard) == of("a")
