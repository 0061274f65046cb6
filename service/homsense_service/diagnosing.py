"""How good a site is, by what it has learnt about itself."""

from collections.abc import Iterable, Sequence

import homsense
from homsense.diagnosis import USUAL_AGE_S
from homsense_service.expecting import Learnt
from homsense_service.records import StoredScan
from homsense_service.site import Site
from homsense_service.sites import SiteRegistry

_MOST_IN_VIEW = 60.0


def diagnosed(sites: SiteRegistry, site: Site, learnt: Learnt) -> homsense.Diagnosis:
    """Return the diagnosis of a site; it takes as many of its scans as it learns from.

    Where the crowd has corrected what is expected, bits are measured on the site itself, and
    whether it is like simulated sites is no longer asked.
    """
    scans, latest = sites.some_scans(site)
    heard = [reading for scan in scans for reading in site.readings(scan.readings)]
    seen = [(scan.device, site.visible(scan.readings)) for scan in scans]
    config = site.config
    return homsense.diagnose(
        site.require_map().site_map,
        learnt.radio,
        learnt.expectation,
        in_view=sum(len(visible) for _, visible in seen) / max(1, len(seen)),
        curve=sites.range_curve(site, scans, most_in_view=_MOST_IN_VIEW),
        min_rssi_dbm=config.min_rssi_dbm,
        median_witnesses=homsense.median_witnesses(seen),
        quorum=config.quorum,
        foretold=homsense.detection_curve(
            _walks(site, latest), site.profiles(config.hops or learnt.expectation.best_hops)
        ),
        detection=config.detection,
        stale_share=_stale_share(heard, config.min_rssi_dbm, config.max_age_s),
        gains=() if learnt.knows_crowd else site.gains(learnt),
    )


def _walks(site: Site, scans: Iterable[StoredScan]) -> list[list[frozenset[str]]]:
    """Return what devices have in view on their walks, scan by scan."""
    walks: dict[tuple[str, object], list[StoredScan]] = {}
    for scan in scans:
        track = None if scan.track is None else scan.track["id"]
        walks.setdefault((scan.device, track), []).append(scan)
    return [
        [site.visible(scan.readings) for scan in sorted(walk, key=lambda one: one.observed_at)]
        for walk in walks.values()
    ]


def _stale_share(
    heard: Sequence[homsense.Reading], min_rssi_dbm: float | None, max_age_s: float | None
) -> float:
    counting = [
        reading.age_s > USUAL_AGE_S
        for reading in heard
        if (max_age_s is None or reading.age_s <= max_age_s)
        and (min_rssi_dbm is None or (reading.rssi_dbm or min_rssi_dbm) >= min_rssi_dbm)
    ]
    return sum(counting) / max(1, len(counting))
