"""What the sensor of a site is expected to count: built in the background, kept by content."""

from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import homsense
from homsense.simulation import WORLDS
from homsense_service.background import Background, Builder, Words
from homsense_service.errors import ExpectationFailedError, ExpectationPendingError
from homsense_service.versions import MapVersion

FloatArray = NDArray[np.float64]

_KEPT = 4
_WORDS = Words(
    "what the sensor counts is being simulated",
    "what the sensor counts cannot be told",
    WORLDS,
    ExpectationPendingError,
    ExpectationFailedError,
)


class WalkedCrowd(NamedTuple):
    """A crowd that has found its place on the map.

    Parameters
    ----------
    xy : ndarray, shape (N, 2), float64
        Where it has been, metres.
    sample : tuple of homsense.WalkScan
        Some of its scans.
    sample_xy : ndarray, shape (S, 2), float64
        Where these were made, metres.
    name : str
        Hash of which scans there were.
    """

    xy: FloatArray
    sample: tuple[homsense.WalkScan, ...]
    sample_xy: FloatArray
    name: str


@dataclass(frozen=True)
class Question:
    """What an expectation depends on.

    Parameters
    ----------
    map_version : MapVersion
        The map.
    sample : mapping of bytes to frozenset of str
        Visible sets of scans from all over the site; never changed, only replaced.
    landmarks, scans : int
        How many the site has.
    in_view : callable
        Returns what counts as visible of some readings.
    profiles : callable
        Returns the holes near each landmark for some neighborhoods.
    crowd : callable
        Returns where the crowd walks, if that is known by then.
    conditions : tuple
        What of the configuration decides what scans are made into.
    """

    map_version: MapVersion
    sample: Mapping[bytes, frozenset[str]]
    landmarks: int
    scans: int
    in_view: Callable[[Iterable[homsense.Reading]], frozenset[str]]
    profiles: Callable[[tuple[int, ...]], homsense.Profiles]
    crowd: Callable[[], WalkedCrowd | None]
    conditions: tuple[object, ...]


@dataclass(frozen=True)
class Learnt:
    """What a site has learnt about its radio and its sensor without any label.

    Parameters
    ----------
    map_digest : str
        The map that it holds for.
    scans : int
        How many there were.
    radio : homsense.RadioModel
        How transmitters are heard.
    expectation : homsense.Expectation
        What is counted where.
    knows_crowd : bool
        Whether it was known where the crowd walks.
    """

    map_digest: str
    scans: int
    radio: homsense.RadioModel
    expectation: homsense.Expectation
    knows_crowd: bool


class Expecting(Background[Question, Learnt]):
    """The expectation of one site.

    Parameters
    ----------
    builder : Builder
        Does the work.
    """

    def __init__(self, builder: Builder) -> None:
        super().__init__(builder, _WORDS)
        self._engine = builder.engine
        self._knew_crowd = False
        self._known: OrderedDict[tuple[object, ...], homsense.Expectation] = OrderedDict()

    def _holds(self, question: Question) -> bool:
        return super()._holds(question) and (self._knew_crowd or question.crowd() is None)

    def _build(self, question: Question, on_step: Callable[[int], None]) -> Learnt:
        space, digest = question.map_version.free_space, question.map_version.digest
        crowd, seen = question.crowd(), list(question.sample.values())
        self._knew_crowd = crowd is not None
        walked = sample_xy = None
        if crowd is not None:
            walked, sample_xy = crowd.xy, crowd.sample_xy
            seen = [question.in_view(scan.readings) for scan in crowd.sample]
        radio = homsense.estimate_radio(
            space,
            seen,
            transmitters=question.landmarks,
            scans=question.scans,
            walked=sample_xy,
        )
        key = (digest, radio, crowd and crowd.name)
        expectation = self._known.pop(key, None)
        if expectation is None:
            expectation = homsense.expect(
                space, radio, walked=walked, engine=self._engine(), on_world=on_step
            )
        self._known[key] = expectation
        while len(self._known) > _KEPT:
            self._known.popitem(last=False)
        if crowd is not None:
            profiles = question.profiles(expectation.hops)
            walks = [scan.walk for scan in crowd.sample]
            counted = homsense.Counted.of(walks, crowd.sample_xy, seen, profiles)
            expectation = homsense.krige(expectation, counted, profiles.sampled())
        return Learnt(digest, question.scans, radio, expectation, crowd is not None)
