"""What the sensor of a site is expected to count: built in the background, kept by content."""

from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import homsense
from homsense.simulation import WORLDS
from homsense_service.background import Background, Builder, CannotError, NotReadyError
from homsense_service.errors import ExpectationFailedError, ExpectationPendingError
from homsense_service.versions import MapVersion

_KEPT = 4
GROWN = 1.25


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
        super().__init__(builder, self._learn, _still_holds)
        self._engine = builder.engine
        self._known: OrderedDict[tuple[object, ...], homsense.Expectation] = OrderedDict()

    def learnt(self, question: Question, wait_s: float) -> Learnt:
        """Return what the site has learnt; an older state of the same map while it builds.

        Parameters
        ----------
        question : Question
            The site as it is now.
        wait_s : float
            How long to wait when nothing is known about this map, seconds.

        Returns
        -------
        Learnt
            For the map of the question.

        Raises
        ------
        ExpectationPendingError
            If it is not ready in time.
        ExpectationFailedError
            If it cannot be built.
        """
        self.refresh(question)
        known, wanted = self.current, question.map_version.digest
        if known is not None and known.map_digest == wanted:
            return known
        try:
            found = self.found(question, wait_s)
        except NotReadyError:
            done = self.progress.done
            message = f"what the sensor counts is being simulated: {done} of {WORLDS}"
            raise ExpectationPendingError(message) from None
        except CannotError as error:
            message = f"what the sensor counts cannot be told: {error}"
            raise ExpectationFailedError(message) from error
        return found if found.map_digest == wanted else self.learnt(question, wait_s)

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


def _still_holds(known: Learnt, question: Question) -> bool:
    is_same_map = known.map_digest == question.map_version.digest
    return is_same_map and question.scans <= GROWN * known.scans
