"""Which sensor a new session gets."""

from dataclasses import replace

from homsense.likelihood import CodeLikelihood, mean_advantage_bits
from homsense_service import schemas
from homsense_service.registering import Registered
from homsense_service.sensors import Sensor
from homsense_service.settings import Settings
from homsense_service.site import Site
from homsense_service.sites import SiteRegistry

HELPFUL_BITS = 0.5
_COUNTED = 200


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
    if wanted.type == "homology":
        return site.sensor(wanted.hops, wanted.expected)
    if wanted.type == "auto":
        return _fitting(sites, site, wanted, settings)
    registered = site.registering.learnt(sites.crowd(site), settings.expectation_wait_s)
    if wanted.type == "registered":
        return Sensor(registered=registered)
    return replace(site.sensor(wanted.hops, wanted.expected), registered=registered)


def _fitting(
    sites: SiteRegistry, site: Site, wanted: schemas.SensorIn, settings: Settings
) -> Sensor:
    counts = wanted.hops is not None or wanted.expected is not None
    found: Registered | None = None
    if site.tracked >= settings.registration_scans and not counts:
        found = site.registering.at_hand(sites.crowd(site))
    if found is None or found.complex.registration.is_doubtful:
        return site.sensor(wanted.hops, wanted.expected)
    counting = site.sensor(wanted.hops, wanted.expected)
    helps = _counts_tell_bits(site, counting, found) > HELPFUL_BITS
    return replace(counting if helps else Sensor(), registered=found)


def _counts_tell_bits(site: Site, sensor: Sensor, crowd: Registered) -> float:
    """Return what counts tell about the place of a scan, judged by a registered crowd."""
    if sensor.noise is None:
        return 0.0
    some = slice(None, None, max(1, len(crowd.sample) // _COUNTED))
    seen = (site.in_view(scan.readings) for scan in crowd.sample[some])
    counted = [site.count(visible, sensor) if visible else None for visible in seen]
    made = [number for number, counts in enumerate(counted) if counts is not None]
    code_map = site.code_map(site.reachable(crowd.map_version), sensor.heights)
    return mean_advantage_bits(
        CodeLikelihood(code_map, sensor.noise),
        [counted[number] for number in made],
        crowd.sample_xy[some][made],
    )
