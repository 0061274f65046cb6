"""The crowd of a site on its map: laid out and placed in the background."""

import hashlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

import homsense
from homsense.backend import Backend
from homsense.radio import MOST_SCANS
from homsense.registered.placing import MOST_LAID_OUT, STAGES
from homsense_service.background import GROWN, Background, Builder, Words
from homsense_service.errors import RegistrationFailedError, RegistrationPendingError
from homsense_service.records import StoredScan
from homsense_service.versions import MapVersion

Result = TypeVar("Result")

EXTENDED = 1.05
HEARINGS = (homsense.Hearing(), homsense.Hearing(weakest_dbm=-95.0))
_WORDS = Words(
    "the crowd is being registered",
    "the crowd cannot be registered",
    len(STAGES) * len(HEARINGS) + 2,
    RegistrationPendingError,
    RegistrationFailedError,
)


@dataclass(frozen=True)
class CrowdQuestion:
    """What a registration depends on.

    Parameters
    ----------
    map_version : MapVersion
        The map.
    reachable : homsense.FreeSpace
        Where devices are looked for.
    scans : int
        Those whose devices keep account of their motion.
    walks : callable
        Returns them.
    rotation_sd_rad : float, optional
        How far the headings of the crowd are from east, radians; unknown when absent.
    conditions : tuple
        What of the configuration decides where the crowd is placed.
    """

    map_version: MapVersion
    reachable: homsense.FreeSpace
    scans: int
    walks: Callable[[], Iterable[homsense.WalkScan]]
    rotation_sd_rad: float | None
    conditions: tuple[object, ...]


@dataclass(frozen=True)
class Registered:
    """A crowd that has found its place, and what sessions need of it.

    Parameters
    ----------
    map_version : MapVersion
        The map that it lies on.
    scans : int
        How many there were, with tracks.
    complex : homsense.RegisteredComplex
        Those that have a place.
    likelihood : homsense.RadioMapLikelihood
        Of a scan, over the map; of as many of them as are of use.
    coverage : float
        Share of the map where the crowd has been.
    information_bits : float
        What a scan tells about its place.
    walked_xy : ndarray, shape (W, 2), float64
        Where it has been, also while it heard too little, metres.
    sample : tuple of homsense.WalkScan
        Some of the scans made there.
    sample_xy : ndarray, shape (S, 2), float64
        Where these were made, metres.
    laid_out : int
        How many there were when the crowd was laid out as a whole; others have joined it since.
    names : str
        Hash of which scans there were.
    conditions : tuple
        Under which it was placed.
    """

    map_version: MapVersion
    scans: int
    complex: homsense.RegisteredComplex
    likelihood: homsense.RadioMapLikelihood
    coverage: float
    information_bits: float
    walked_xy: NDArray[np.float64]
    sample: tuple[homsense.WalkScan, ...]
    sample_xy: NDArray[np.float64]
    laid_out: int = 0
    names: str = ""
    conditions: tuple[object, ...] = ()

    @property
    def map_digest(self) -> str:
        """The map that it lies on."""
        return self.map_version.digest


class Registering(Background[CrowdQuestion, Registered]):
    """The registration of one site.

    Parameters
    ----------
    builder : Builder
        Does the work.
    """

    def __init__(self, builder: Builder) -> None:
        super().__init__(builder, _WORDS, EXTENDED)
        self._backend = builder.backend

    def _build(self, question: CrowdQuestion, on_step: Callable[[int], None]) -> Registered:
        scans = list(question.walks())
        known = self.current
        if known is None or not _can_grow(known, question, scans):
            return _register(question, scans, on_step, self._backend)
        site_map = question.map_version.site_map
        reachable, backend = question.reachable, self._backend()
        found = homsense.extend(known.complex, scans, site_map, reachable, backend=backend)
        on_step(_WORDS.steps)
        return _registered(question, scans, found, known.laid_out, backend)


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


def of_each_hearing(attempt: Callable[[int, homsense.Hearing], Result]) -> list[Result]:
    """Try everything that may be heard of a scan.

    Parameters
    ----------
    attempt : callable
        Takes the number of the hearing from 0 and the hearing itself.

    Returns
    -------
    list
        What has come out; at least one.

    Raises
    ------
    homsense.InvalidInputError
        If each of them is refused.
    """
    found: list[Result] = []
    for number, hearing in enumerate(HEARINGS):
        try:
            found.append(attempt(number, hearing))
        except homsense.InvalidInputError:
            if hearing is HEARINGS[-1] and not found:
                raise
    return found


def _can_grow(
    known: Registered, question: CrowdQuestion, scans: Sequence[homsense.WalkScan]
) -> bool:
    """Tell whether scans can join a crowd that has been placed: few, and none of it deleted."""
    return (
        known.map_digest == question.map_version.digest
        and known.conditions == question.conditions
        and known.complex.registration.is_doubtful is False
        and known.scans < len(scans) <= GROWN * known.laid_out
        and known.names == _names(scans[: known.scans])
    )


def _names(scans: Iterable[homsense.WalkScan]) -> str:
    digest = hashlib.sha256()
    for scan in scans:
        digest.update(f"{scan.walk}\0{scan.t_s!r}\n".encode())
    return digest.hexdigest()


def _register(
    question: CrowdQuestion,
    scans: Sequence[homsense.WalkScan],
    on_step: Callable[[int], None],
    backend: Callable[[], Backend],
) -> Registered:
    version, reachable = question.map_version, question.reachable

    def registered(number: int, hearing: homsense.Hearing) -> homsense.RegisteredComplex:
        begin = number * len(STAGES) + 1
        return homsense.register_crowd(
            scans,
            version.free_space,
            hearing=hearing,
            rotation_sd_rad=question.rotation_sd_rad,
            on_stage=lambda stage: on_step(begin + STAGES.index(stage)),
        )

    best = min(of_each_hearing(registered), key=lambda one: one.registration.cost_m)
    found = homsense.smooth(best, scans, version.site_map, reachable, backend=backend())
    on_step(_WORDS.steps - 1)
    if len(scans) > MOST_LAID_OUT:
        found = homsense.extend(found, scans, version.site_map, reachable, backend=backend())
    on_step(_WORDS.steps)
    return _registered(question, scans, found, len(scans), backend())


def _registered(
    question: CrowdQuestion,
    scans: Sequence[homsense.WalkScan],
    found: homsense.RegisteredComplex,
    laid_out: int,
    backend: Backend,
) -> Registered:
    version = question.map_version
    walked = homsense.retrace(found, scans)
    some = walked.stretches(MOST_SCANS)
    likelihood = homsense.RadioMapLikelihood(found.thinned(), question.reachable, backend)
    free = version.free_space
    ground = free.grid.centers()[free.free[:-1]]
    return Registered(
        version,
        len(scans),
        found,
        likelihood,
        float(found.covers(ground).mean()),
        likelihood.information_bits,
        walked.xy,
        tuple(scans[source] for source in walked.source[some].tolist()),
        walked.xy[some],
        laid_out,
        _names(scans),
        question.conditions,
    )
