"""A site's versions are replaced whole, so that readers need no lock."""

import tracemalloc
from dataclasses import replace

import pytest
from homsense_service.records import SiteConfig, StoredReading, StoredScan
from homsense_service.settings import Settings
from homsense_service.site import Site

NOW_S = 1000.0


def _scans(first: int, count: int) -> list[StoredScan]:
    return [
        StoredScan("phone", str(n), 0.0, (StoredReading(f"l{n}"), StoredReading(f"l{n + 1}")))
        for n in range(first, first + count)
    ]


def test_a_sample_in_use_survives_scans_that_pour_in() -> None:
    site = Site("a", SiteConfig(), Settings(calibration_scans=5))
    site.absorb(_scans(0, 20), NOW_S)
    in_use = site._sample
    before = dict(in_use)
    site.absorb(_scans(20, 200), NOW_S)
    assert in_use == before
    assert len(site._sample) == 5
    assert site._sample != before


def test_an_answer_is_counted_again_only_when_its_neighborhood_has_changed() -> None:
    site = Site("a", SiteConfig(), Settings())
    site.absorb(_scans(0, 20), NOW_S)
    visible = frozenset({"l0", "not known yet"})
    near = site.sense(visible, (2,))
    site.absorb(_scans(100, 5), NOW_S)
    assert site.sense(visible, (2,)) is near
    site.absorb(_scans(2, 1), NOW_S)
    assert site.sense(visible, (2,)) is near
    site.absorb([StoredScan("p", "x", 0.0, (StoredReading("l2"), StoredReading("l9")))], NOW_S)
    changed = site.sense(visible, (2,))
    assert changed is not near
    assert changed[0].landmark_complex.n_landmarks > near[0].landmark_complex.n_landmarks
    site.absorb(
        [StoredScan("p", "y", 0.0, (StoredReading("not known yet"), StoredReading("z")))], NOW_S
    )
    assert "z" in site.sense(visible, (2,))[0].landmarks


def test_a_complex_is_counted_once_until_scans_come() -> None:
    site = Site("a", SiteConfig(), Settings())
    site.absorb(_scans(0, 20), NOW_S)
    counts = site.complex.counts
    assert site.complex.counts is counts
    assert (counts.landmarks, counts.edges, counts.betti, counts.euler) == (21, 20, (1, 0), 1)
    assert counts.digest == site.complex.sensed.digest()
    site.absorb([StoredScan("p", "x", 0.0, (StoredReading("l0"), StoredReading("l20")))], NOW_S)
    closed = site.complex.counts
    assert (closed.landmarks, closed.edges, closed.betti, closed.euler) == (21, 21, (1, 1), 0)
    assert closed.raw_betti == (1, 1)


def test_the_sample_does_not_depend_on_the_order_of_arrival() -> None:
    one, other = (Site("a", SiteConfig(), Settings(calibration_scans=5)) for _ in range(2))
    one.absorb(_scans(0, 60), NOW_S)
    for scan in reversed(_scans(0, 60)):
        other.absorb([scan], NOW_S)
    assert one._sample == other._sample


def test_scans_are_forgotten_by_epochs_and_the_clock_of_a_phone_decides_nothing() -> None:
    def seen(name: str, at_s: float) -> StoredScan:
        return StoredScan("phone", name, at_s, (StoredReading(name), StoredReading("hub")))

    site = Site("a", SiteConfig(retention=(100.0, 2)), Settings())
    site.absorb([seen("old", 50.0), seen("last", 150.0), seen("now", 250.0)], 299.0)
    assert site.complex.landmark_complex.landmarks == {"last", "now", "hub"}
    site.absorb([seen("late", 180.0), seen("2038", 2.1e9)], 299.0)
    assert site.complex.landmark_complex.landmarks == {"last", "late", "now", "2038", "hub"}
    generation = site.complex.generation
    site.absorb([], 301.0)
    assert site.complex.landmark_complex.landmarks == {"now", "2038", "hub"}
    assert site.complex.generation > generation
    site.absorb([], 500.0)
    assert site.complex.landmark_complex.n_landmarks == 0


@pytest.mark.parametrize(
    "config",
    [SiteConfig(), SiteConfig(quorum=2), SiteConfig(retention=(1e6, 2))],
    ids=["plain", "witnessed", "forgetting"],
)
def test_a_scan_takes_its_own_size_however_many_devices_and_landmarks_there_are(
    config: SiteConfig,
) -> None:
    site = Site("a", config, Settings(calibration_scans=5))
    for first in range(0, 10_000, 1000):
        site.absorb([replace(scan, device=scan.scan_id) for scan in _scans(first, 1000)], NOW_S)
    (last,) = _scans(10_000, 1)
    site.absorb([replace(last, device="p")], NOW_S)
    tracemalloc.start()
    try:
        site.absorb([replace(last, device="q", scan_id="again")], NOW_S)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 250_000
    assert len(site.complex.devices) == 10_002
