"""What the sensor of a site is expected to count: built in the background, kept by content."""

from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import homsense
from homsense.simulation import WORLDS
from homsense_service.background import Background, Builder, Words
from homsense_service.errors import ExpectationFailedError, ExpectationPendingError
from homsense_service.versions import MapVersion

_KEPT = 4
_WORDS = Words(
    "what the sensor counts is being simulated",
    "what the sensor counts cannot be told",
    WORLDS,
    ExpectationPendingError,
    ExpectationFailedError,
)


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
    """

    map_version: MapVersion
    sample: Mapping[bytes, frozenset[str]]
    landmarks: int
    scans: int


@dataclass(frozen=True)
class Learnt:
    """What a site has learnt about its radio and its sensor from its scans alone.

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
    """

    map_digest: str
    scans: int
    radio: homsense.RadioModel
    expectation: homsense.Expectation


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

    def _learn(self, question: Question, on_world: Callable[[int], None]) -> Learnt:
        space, digest = question.map_version.free_space, question.map_version.digest
        radio = homsense.estimate_radio(
            space,
            list(question.sample.values()),
            transmitters=question.landmarks,
            scans=question.scans,
        )
        key = (digest, radio)
        expectation = self._known.pop(key, None)
        if expectation is None:
            expectation = homsense.expect(space, radio, engine=self._engine(), on_world=on_world)
        self._known[key] = expectation
        while len(self._known) > _KEPT:
            self._known.popitem(last=False)
        return Learnt(digest, question.scans, radio, expectation)
