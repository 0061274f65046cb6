"""A site's versions are replaced whole, so that readers need no lock."""

from homsense_service.records import SiteConfig, StoredReading, StoredScan
from homsense_service.settings import Settings
from homsense_service.sites import Site


def _scans(first: int, count: int) -> list[StoredScan]:
    return [
        StoredScan("phone", str(n), 0.0, (StoredReading(f"l{n}"), StoredReading(f"l{n + 1}")))
        for n in range(first, first + count)
    ]


def test_a_sample_in_use_survives_scans_that_pour_in() -> None:
    site = Site("a", SiteConfig(), Settings(calibration_scans=5))
    site.absorb(_scans(0, 20))
    in_use = site._sample
    before = dict(in_use)
    site.absorb(_scans(20, 200))
    assert in_use == before
    assert len(site._sample) == 5
    assert site._sample != before


def test_the_sample_does_not_depend_on_the_order_of_arrival() -> None:
    one, other = (Site("a", SiteConfig(), Settings(calibration_scans=5)) for _ in range(2))
    one.absorb(_scans(0, 60))
    for scan in reversed(_scans(0, 60)):
        other.absorb([scan])
    assert one._sample == other._sample
