"""What the sensor of a site is expected to count: built in the background, kept by content."""

import threading
from collections import OrderedDict
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as TooLate
from dataclasses import dataclass
from typing import Literal

import homsense
from homsense.engine import Engine
from homsense.expectation import HOPS
from homsense.simulation import WORLDS
from homsense_service.errors import ExpectationFailedError, ExpectationPendingError
from homsense_service.versions import MapVersion

_KEPT = 4
_GROWN = 1.25
_STOPPED = "the service stops"


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


@dataclass(frozen=True, slots=True)
class Progress:
    """How far the building is."""

    state: Literal["none", "building", "ready", "failed"]
    done: int = 0
    of: int = WORLDS
    reason: str | None = None


class Builder:
    """Builds one expectation after the other.

    Parameters
    ----------
    engine : callable
        Returns what runs the hot loops.
    """

    def __init__(self, engine: Callable[[], Engine]) -> None:
        self.engine = engine
        self.pool = ThreadPoolExecutor(1, thread_name_prefix="expecting")
        self.stopping = threading.Event()

    def close(self) -> None:
        """Stop after the placement at hand."""
        self.stopping.set()
        self.pool.shutdown(cancel_futures=True)


class Expecting:
    """The expectation of one site.

    Parameters
    ----------
    builder : Builder
        Does the work.
    """

    def __init__(self, builder: Builder) -> None:
        self._builder = builder
        self._lock = threading.Lock()
        self._current: Learnt | None = None
        self._building: Future[Learnt] | None = None
        self._known: OrderedDict[tuple[object, ...], homsense.Expectation] = OrderedDict()
        self._progress = Progress("none")

    @property
    def progress(self) -> Progress:
        """How far the building is."""
        return self._progress

    @property
    def current(self) -> Learnt | None:
        """The latest that was built, if any; its map may have been replaced since."""
        return self._current

    def refresh(self, question: Question) -> Future[Learnt] | None:
        """Begin to build when map or scans have changed much since, unless that goes on already.

        Parameters
        ----------
        question : Question
            The site as it is now.

        Returns
        -------
        Future of Learnt, optional
            None when what is known still holds.
        """
        with self._lock:
            if self._building is None and not self._holds(question):
                self._progress = Progress("building")
                self._building = self._builder.pool.submit(self._build, question)
            return self._building

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
        building, current = self.refresh(question), self._current
        wanted = question.map_version.digest
        if current is not None and current.map_digest == wanted:
            return current
        assert building is not None
        try:
            found = building.result(wait_s)
        except TooLate:
            done = self._progress
            message = f"what the sensor counts is being simulated: {done.done} of {done.of}"
            raise ExpectationPendingError(message) from None
        except (homsense.HomsenseError, RuntimeError) as error:
            message = f"what the sensor counts cannot be told: {error}"
            raise ExpectationFailedError(message) from error
        if found.map_digest != wanted:
            return self.learnt(question, wait_s)
        return found

    def _holds(self, question: Question) -> bool:
        known = self._current
        return (
            known is not None
            and known.map_digest == question.map_version.digest
            and question.scans <= _GROWN * known.scans
        )

    def _build(self, question: Question) -> Learnt:
        try:
            learnt = self._learn(question)
        except BaseException as error:
            self._finish(Progress("failed", reason=str(error)))
            raise
        self._current = learnt
        self._finish(Progress("ready", WORLDS))
        return learnt

    def _finish(self, progress: Progress) -> None:
        with self._lock:
            self._progress, self._building = progress, None

    def _learn(self, question: Question) -> Learnt:
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
            expectation = homsense.expect(
                space, radio, engine=self._builder.engine(), on_world=self._on_world
            )
        self._known[key] = expectation
        while len(self._known) > _KEPT:
            self._known.popitem(last=False)
        return Learnt(digest, question.scans, radio, expectation)

    def _on_world(self, done: int) -> None:
        if self._builder.stopping.is_set():
            raise RuntimeError(_STOPPED)
        self._progress = Progress("building", done)


@dataclass(frozen=True)
class Sensor:
    """How a session measures, and what it compares with.

    Parameters
    ----------
    expected : {"geometric", "simulated"}
        Structures within a radius, or a simulation of sites like this one.
    hops : tuple of int
        The neighborhoods.
    heights : tuple of homsense.HeightMap
        What the localizer looks up.
    noise : homsense.FieldNoise, optional
        The error of the measurement; the session's own when absent.
    """

    expected: Literal["geometric", "simulated"]
    hops: tuple[int, ...]
    heights: tuple[homsense.HeightMap, ...]
    noise: homsense.FieldNoise | None = None


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
    return Sensor("simulated", expected.hops, (*expected.heights, *expected.spreads), noise)
