"""The crowd of a site on its map: laid out and placed in the background."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import homsense
from homsense.registered.complex import STAGES
from homsense_service.background import Background, Builder, CannotError, NotReadyError
from homsense_service.errors import RegistrationFailedError, RegistrationPendingError
from homsense_service.records import StoredScan
from homsense_service.versions import MapVersion

BLOCK_M = 3.0
SAMPLED = 200
GROWN = 1.25
HEARINGS = (homsense.Hearing(), homsense.Hearing(weakest_dbm=-95.0))


@dataclass(frozen=True)
class CrowdQuestion:
    """What a registration depends on.

    Parameters
    ----------
    map_version : MapVersion
        The map.
    reachable : homsense.FreeSpace
        Where devices are looked for.
    tracked : int
        Scans whose devices keep account of their motion.
    scans : callable
        Returns them.
    rotation_sd_rad : float, optional
        How far the headings of the crowd are from east, radians; unknown when absent.
    """

    map_version: MapVersion
    reachable: homsense.FreeSpace
    tracked: int
    scans: Callable[[], Iterable[homsense.WalkScan]]
    rotation_sd_rad: float | None


@dataclass(frozen=True)
class Registered:
    """A crowd that has found its place, and what sessions need of it.

    Parameters
    ----------
    map_version : MapVersion
        The map that it lies on.
    tracked : int
        Scans that there were.
    complex : homsense.RegisteredComplex
        Those that hang together, with places.
    likelihood : homsense.PlaceLikelihood
        Of a scan, over the map.
    coverage : float
        Share of the map where the crowd has been.
    sample : tuple of tuple of homsense.Reading
        What some of its scans heard.
    sample_xy : ndarray, shape (S, 2), float64
        Where those were made, metres.
    """

    map_version: MapVersion
    tracked: int
    complex: homsense.RegisteredComplex
    likelihood: homsense.PlaceLikelihood
    coverage: float
    sample: tuple[tuple[homsense.Reading, ...], ...]
    sample_xy: NDArray[np.float64]


class Registering(Background[CrowdQuestion, Registered]):
    """The registration of one site.

    Parameters
    ----------
    builder : Builder
        Does the work.
    """

    def __init__(self, builder: Builder) -> None:
        super().__init__(builder, _register, _still_holds)

    def at_hand(self, question: CrowdQuestion) -> Registered | None:
        """Return the crowd on this map if it is there already; begin to place it if not.

        Parameters
        ----------
        question : CrowdQuestion
            The site as it is now.

        Returns
        -------
        Registered or None
            For the map of the question.
        """
        self.refresh(question)
        known = self.current
        is_same_map = known and known.map_version.digest == question.map_version.digest
        return known if is_same_map else None

    def registered(self, question: CrowdQuestion, wait_s: float) -> Registered:
        """Return the crowd on the map; an older state of the same map while it is redone.

        Parameters
        ----------
        question : CrowdQuestion
            The site as it is now.
        wait_s : float
            How long to wait when there is none on this map, seconds.

        Returns
        -------
        Registered
            For the map of the question.

        Raises
        ------
        RegistrationPendingError
            If it is not ready in time.
        RegistrationFailedError
            If the crowd finds no place.
        """
        if (known := self.at_hand(question)) is not None:
            return known
        wanted = question.map_version.digest
        try:
            found = self.found(question, wait_s)
        except NotReadyError:
            done = self.progress.done
            message = f"the crowd is being registered: {done} of {len(STAGES) * len(HEARINGS)}"
            raise RegistrationPendingError(message) from None
        except CannotError as error:
            message = f"the crowd cannot be registered: {error}"
            raise RegistrationFailedError(message) from error
        return found if found.map_version.digest == wanted else self.registered(question, wait_s)


def walk_scan(scan: StoredScan, readings: Iterable[homsense.Reading]) -> homsense.WalkScan | None:
    """Return a stored scan as one of a walk; None when its device gave no account of its motion.

    Parameters
    ----------
    scan : StoredScan
        As it was posted.
    readings : iterable of homsense.Reading
        What it heard, as the site compares identifiers.

    Returns
    -------
    homsense.WalkScan or None
        In the frame of the track.
    """
    if scan.track is None:
        return None
    walk = f"{scan.device}\0{scan.track['id']}"
    place = float(scan.track["x_m"]), float(scan.track["y_m"])
    return homsense.WalkScan(walk, scan.observed_at, *place, tuple(readings))


def _register(question: CrowdQuestion, on_step: Callable[[int], None]) -> Registered:
    version, scans, done = question.map_version, list(question.scans()), 0

    def reached(_stage: str) -> None:
        nonlocal done
        done += 1
        on_step(done)

    tried = [
        homsense.register_crowd(
            scans,
            version.free_space,
            hearing=hearing,
            rotation_sd_rad=question.rotation_sd_rad,
            on_stage=reached,
        )
        for hearing in HEARINGS
    ]
    found = min(tried, key=lambda one: one.registration.cost_m)
    some = np.arange(0, found.size, max(1, found.size // SAMPLED))
    blocks = homsense.CodeMap.blocks(question.reachable, BLOCK_M)
    ground = homsense.CodeMap.blocks(version.free_space, BLOCK_M).expected[1:]
    return Registered(
        version,
        question.tracked,
        found,
        homsense.PlaceLikelihood(found, blocks),
        float(found.covers(ground).mean()),
        tuple(scans[source].readings for source in found.source[some]),
        found.xy[some],
    )


def _still_holds(known: Registered, question: CrowdQuestion) -> bool:
    is_same_map = known.map_version.digest == question.map_version.digest
    return is_same_map and question.tracked <= GROWN * known.tracked
