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


def test_an_answer_is_counted_again_only_when_its_neighborhood_has_changed() -> None:
    site = Site("a", SiteConfig(), Settings())
    site.absorb(_scans(0, 20))
    visible = frozenset({"l0", "not known yet"})
    near = site.sense(visible, (2,))
    site.absorb(_scans(100, 5))
    assert site.sense(visible, (2,)) is near
    site.absorb(_scans(2, 1))
    assert site.sense(visible, (2,)) is near
    site.absorb([StoredScan("p", "x", 0.0, (StoredReading("l2"), StoredReading("l9")))])
    changed = site.sense(visible, (2,))
    assert changed is not near
    assert changed[0].landmark_complex.n_landmarks > near[0].landmark_complex.n_landmarks
    site.absorb([StoredScan("p", "y", 0.0, (StoredReading("not known yet"), StoredReading("z")))])
    assert "z" in site.sense(visible, (2,))[0].landmarks


def test_the_sample_does_not_depend_on_the_order_of_arrival() -> None:
    one, other = (Site("a", SiteConfig(), Settings(calibration_scans=5)) for _ in range(2))
    one.absorb(_scans(0, 60))
    for scan in reversed(_scans(0, 60)):
        other.absorb([scan])
    assert one._sample == other._sample
