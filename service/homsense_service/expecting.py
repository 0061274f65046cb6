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
        Where its scans were made, metres.
    sample_xy : ndarray, shape (S, 2), float64
        Where some of them were made, metres.
    seen : callable
        Returns what these have in view.
    name : str
        Hash of which scans there were.
    """

    xy: FloatArray
    sample_xy: FloatArray
    seen: Callable[[], Iterable[frozenset[str]]]
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
    crowd : callable
        Returns where the crowd walks, if that is known by then.
    """

    map_version: MapVersion
    sample: Mapping[bytes, frozenset[str]]
    landmarks: int
    scans: int
    crowd: Callable[[], WalkedCrowd | None]


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
        super().__init__(builder, self._learn, _WORDS)
        self._engine = builder.engine
        self._known: OrderedDict[tuple[object, ...], homsense.Expectation] = OrderedDict()

    def _holds(self, question: Question) -> bool:
        known = self.current
        is_informed = known is not None and known.knows_crowd
        return super()._holds(question) and (is_informed or question.crowd() is None)

    def _learn(self, question: Question, on_world: Callable[[int], None]) -> Learnt:
        space, digest = question.map_version.free_space, question.map_version.digest
        crowd = question.crowd()
        radio = homsense.estimate_radio(
            space,
            list(question.sample.values() if crowd is None else crowd.seen()),
            transmitters=question.landmarks,
            scans=question.scans,
            walked=None if crowd is None else crowd.sample_xy,
        )
        key = (digest, radio, crowd and crowd.name)
        expectation = self._known.pop(key, None)
        if expectation is None:
            expectation = homsense.expect(
                space,
                radio,
                walked=None if crowd is None else crowd.xy,
                engine=self._engine(),
                on_world=on_world,
            )
        self._known[key] = expectation
        while len(self._known) > _KEPT:
            self._known.popitem(last=False)
        return Learnt(digest, question.scans, radio, expectation, crowd is not None)
