"""Which sensor a new session gets."""

from dataclasses import replace

from homsense_service import schemas
from homsense_service.registering import Registered
from homsense_service.sensors import Sensor
from homsense_service.settings import Settings
from homsense_service.site import Site
from homsense_service.sites import SiteRegistry

HELPFUL = 2.0 / 3.0
"""Share of the bits that recognizing a scan tells."""


def chosen(
    sites: SiteRegistry, site: Site, wanted: schemas.SensorIn, settings: Settings
) -> Sensor:
    """Return the sensor that is asked for; by default the one that the site is fit for.

    Parameters
    ----------
    sites : SiteRegistry
        All sites.
    site : Site
        Where.
    wanted : SensorIn
        What is asked for.
    settings : Settings
        How long what the site has to learn is waited for.

    Returns
    -------
    Sensor
        Counting, recognizing, or both.

    Raises
    ------
    ServiceError
        If it has not been learnt in time, or cannot be.
    """
    if wanted.type in {"auto", "homology"}:
        found = None if wanted.expected == "geometric" else sites.placed(site)
        counting = site.sensor(wanted.hops, wanted.expected)
        is_free = wanted.type == "auto" and wanted.hops is None and wanted.expected is None
        return _fitting(site, counting, found) if is_free else counting
    registered = site.registering.learnt(sites.crowd(site), settings.expectation_wait_s)
    if wanted.type == "registered":
        return Sensor(registered=registered)
    return replace(site.sensor(wanted.hops, wanted.expected), registered=registered)


def _fitting(site: Site, counting: Sensor, found: Registered | None) -> Sensor:
    if found is None or found.complex.registration.is_doubtful:
        return counting
    return replace(counting if _counts_help(site, counting, found) else Sensor(), registered=found)


def _counts_help(site: Site, counting: Sensor, found: Registered) -> bool:
    """Tell whether counts say enough beside a crowd, judged by walks of it that are left out."""
    if counting.noise is None:
        return False
    learnt = site.learnt()
    told = learnt.expectation.narrowed(counting.hops).information_bits
    return learnt.knows_crowd and max(told, default=0.0) >= HELPFUL * found.information_bits
