"""How a session measures."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Literal

import homsense
from homsense.detection import LAST_SCAN, Detection
from homsense.expectation import HOPS
from homsense_service.expecting import Learnt
from homsense_service.registering import Registered

Kind = Literal["homology", "registered", "both"]


@dataclass(frozen=True)
class Sensor:
    """What a session counts or recognizes, and what it compares with.

    Parameters
    ----------
    hops : tuple of int
        The neighborhoods whose holes are counted; none when nothing is counted.
    expected : {"geometric", "simulated"}, optional
        Structures within a radius, or a simulation of sites like this one.
    heights : tuple of homsense.HeightMap
        What is expected of the counts.
    noise : homsense.FieldNoise, optional
        The error of the counts; the session's own when absent.
    detection : Detection
        In how many of the last scans a landmark must have been heard to be in view.
    registered : Registered, optional
        The crowd among which a scan is recognized.
    """

    hops: tuple[int, ...] = ()
    expected: Literal["geometric", "simulated"] | None = None
    heights: tuple[homsense.HeightMap, ...] = ()
    noise: homsense.FieldNoise | None = None
    detection: Detection = LAST_SCAN
    registered: Registered | None = None

    @property
    def kind(self) -> Kind:
        """What is measured."""
        if self.registered is None:
            return "homology"
        return "both" if self.hops else "registered"


@dataclass(frozen=True, slots=True)
class Measured:
    """What a scan was worth.

    Parameters
    ----------
    holes : tuple of float, optional
        Counts of each neighborhood.
    sighting : homsense.Sighting, optional
        Scans of the crowd that it resembles.
    seen : tuple of frozenset of str
        What it and the scans before it have heard, as far as later scans need that.
    """

    holes: tuple[float, ...] | None = None
    sighting: homsense.Sighting | None = None
    seen: tuple[frozenset[str], ...] = ()

    def by(self, kind: Kind) -> object | None:
        """Return it as the likelihood of a sensor takes it; None when nothing is to be weighed."""
        if kind == "homology":
            return self.holes
        if kind == "registered":
            return self.sighting
        if self.holes is None and self.sighting is None:
            return None
        return homsense.JointMeasurement(self.sighting, self.holes)


def check_simulated(hops: Collection[int]) -> None:
    """Raise `homsense.InvalidConfigurationError` unless all these hops are simulated."""
    if not {*hops} <= {*HOPS}:
        message = f"simulated counts are of hops {HOPS[0]} to {HOPS[-1]}"
        raise homsense.InvalidConfigurationError(message, "sensor.hops")


def simulated_sensor(
    learnt: Learnt, hops: Sequence[int] | None, profiles: Callable[..., homsense.Profiles]
) -> Sensor:
    """Return the sensor that a site's expectation belongs to.

    Parameters
    ----------
    learnt : Learnt
        What the site knows.
    hops : sequence of int, optional
        Neighborhoods; those with information when absent.
    profiles : callable
        Returns the holes near each landmark for some neighborhoods.

    Returns
    -------
    Sensor
        With gain and offset of this site.
    """
    expected = learnt.expectation.narrowed(hops or learnt.expectation.best_hops)
    noise = expected.noise(profiles(expected.hops).sampled())
    return Sensor(expected.hops, "simulated", (*expected.heights, *expected.spreads), noise)
