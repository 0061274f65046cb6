"""What the service does. Every rim parses, calls one of these, and renders the answer."""

import secrets
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import homsense
from homsense.backend import Backend, fastest
from homsense_service import schemas
from homsense_service.archive import Archive
from homsense_service.choosing import chosen
from homsense_service.diagnosing import diagnosed
from homsense_service.errors import IdempotencyError
from homsense_service.expecting import Expecting
from homsense_service.floors import FloorsQuestion
from homsense_service.localizing import localizing, restored, run_document
from homsense_service.portable import exported
from homsense_service.pseudonyms import Pseudonyms
from homsense_service.records import (
    Binding,
    KeyRecord,
    SessionRecord,
    StoredReading,
    StoredScan,
)
from homsense_service.registering import Registering
from homsense_service.revisions import Expected, whatever
from homsense_service.runs import Course, Fix, Run, Step
from homsense_service.session_table import SessionTable
from homsense_service.sessions import Means, RestingError, Session
from homsense_service.settings import Settings
from homsense_service.site import Site
from homsense_service.sites import SiteRegistry
from homsense_service.store import Store
from homsense_service.turns import Questions, Turns
from homsense_service.watching import Watch, unwatched

Answer = TypeVar("Answer")

AT_ONCE = 1


@dataclass(frozen=True, slots=True)
class Ingested:
    """What became of a batch of scans."""

    accepted: int
    duplicate: int
    dropped: list[tuple[int, str]]
    complex_version: int


@dataclass(frozen=True, slots=True)
class Sensed:
    """The answer of the homological sensor.

    Parameters
    ----------
    site : Site
        Where.
    visible : frozenset of str
        The landmarks in view.
    levels, raw : list of homsense.LocalHomology
        What a quorum has seen, and what anybody has.
    """

    site: Site
    visible: frozenset[str]
    levels: list[homsense.LocalHomology]
    raw: list[homsense.LocalHomology]


class Operations:
    """The service without any rim.

    Parameters
    ----------
    sites : SiteRegistry
        All sites.
    store : Store
        Where all survives.
    settings : Settings
        Limits.
    clock : callable
        Returns Unix seconds.
    backend : callable
        Returns what runs the filters now.
    """

    def __init__(
        self,
        sites: SiteRegistry,
        store: Store,
        settings: Settings,
        clock: Callable[[], float],
        backend: Callable[[], Backend] = fastest,
    ) -> None:
        self.sites, self._store, self._settings = sites, store, settings
        self._clock, self._backend = clock, backend
        self.watch: Watch = unwatched
        self._turn = threading.Semaphore(AT_ONCE)
        self.ask = Questions().answer
        self._asking = Turns()
        self._archive = Archive(store.artifact)
        secret = settings.hash_key
        self._names = Pseudonyms(None if secret is None else secret.get_secret_value().encode())
        self.sessions = SessionTable(settings.max_sessions, store, self._wake, clock)

    def check(self) -> None:
        """Raise `StoreError` when the store does not answer."""
        self._store.check()

    def commit_age_s(self) -> float:
        """Return how long the transaction at hand goes on, seconds; 0 between two."""
        return self._store.age_s()

    def export(self, name: str) -> Iterator[bytes]:
        """Return the file of a site, piece by piece."""
        return exported(self._store, self.sites.get(name).name)

    def now_s(self) -> float:
        """Return Unix seconds."""
        return self._clock()

    def tidy(self) -> list[str]:
        """Forget old scans; let idle sessions sleep, close those idle for too long, name these."""
        self.sites.expire()
        return self.sessions.tidy(self._settings.session_sleep_s, self._settings.session_expiry_s)

    def known_keys(self) -> list[KeyRecord]:
        """Return all keys by name."""
        return self._store.api_keys()

    def add_key(self, record: KeyRecord) -> None:
        """Keep a key or raise `KeyExistsError`."""
        self._store.add_key(record)

    def delete_key(self, name: str) -> None:
        """Delete a key or raise `KeyNotFoundError`."""
        self._store.delete_key(name)

    def delete_site(self, name: str, expected: Expected = whatever) -> None:
        """Delete a site and close its sessions."""
        self.sites.delete(name, expected)
        self.sessions.forget_site(name)

    def ingest_scans(
        self, name: str, batch: Sequence[schemas.ScanIn | schemas.DroppedScan]
    ) -> Ingested:
        """Log the sound scans of a batch, then join them into the complex."""
        site = self.sites.get(name)
        sound: list[StoredScan] = []
        dropped: list[tuple[int, str]] = []
        for index, scan in enumerate(batch):
            try:
                sound.append(self._names.scan(self._stored(scan), site.config.landmark_key))
            except ValueError as error:
                dropped.append((index, str(error)))
        fresh, version = self.sites.add_scans(site, sound)
        return Ingested(sum(fresh), len(fresh) - sum(fresh), dropped, version.number)

    def sense(self, name: str, question: schemas.LocalHomologyIn) -> Sensed:
        """Count the holes near a scan, in what a quorum has seen and in everything."""
        site = self.sites.get(name)
        heard = schemas.readings(question.landmarks)
        visible = site.visible(self._names.readings(heard, site.config.landmark_key))
        if question.r_pseudo_m is not None:
            levels = site.sense_within(visible, question.r_pseudo_m)
        else:
            hops = tuple(question.hops or site.config.near_and_far)
            levels = site.sense(visible, hops, lasting=question.lasting)
        is_raw = site.config.quorum == 1 and not site.complex.quarantine
        raw = levels if is_raw else site.sense_raw(visible, levels)
        return Sensed(site, visible, levels, raw)

    def expect(self, name: str) -> Expecting:
        """Begin to simulate what the sensor of a site counts, if that is not known."""
        site = self.sites.get(name)
        self.sites.placed(site)
        site.expecting.refresh(site.question())
        return site.expecting

    def diagnose(self, name: str) -> homsense.Diagnosis:
        """Judge a site by what it has learnt about itself."""
        site = self.sites.get(name)
        self.sites.placed(site)
        learnt = site.learnt()
        return self.ask((name, "diagnosis"), lambda: diagnosed(self.sites, site, learnt))

    def open_session(
        self, site_name: str, request: schemas.SessionIn, asked_as: str | None = None
    ) -> Session:
        """Start localizing a device on a site; what that takes is on disk.

        Parameters
        ----------
        site_name : str
            Where.
        request : SessionIn
            How.
        asked_as : str, optional
            Names the request: asked again, it gets the session that it got before.

        Returns
        -------
        Session
            At its start, or where it is by now.

        Raises
        ------
        ServiceError
            If it cannot be opened now, or the name stands for another request.
        """
        if asked_as is None:
            return self._opened(site_name, request, None)
        with self._asking.of(asked_as):
            known = self.sessions.asked_as(asked_as)
            if known is None:
                return self._opened(site_name, request, asked_as)
            session = self.sessions.get(known)
            record = session.record
            if (record.site, record.document["request"]) != (site_name, request.model_dump_json()):
                message = "another session was asked for under this name before"
                raise IdempotencyError(message)
            return session

    def _opened(self, site_name: str, request: schemas.SessionIn, asked_as: str | None) -> Session:
        self._check_size(request)
        site = self.sites.get(site_name)
        run = self._run(site, request.sensor, request)
        seed = secrets.randbits(64) if request.seed is None else request.seed
        course = Course.begun(run, seed)
        document, artifacts = run_document(run, self._archive)
        record = SessionRecord(
            secrets.token_urlsafe(12),
            site_name,
            self._clock(),
            {
                "seed": seed,
                "contribute": request.contribute,
                "request": request.model_dump_json(),
                "run": document,
                "asked_as": asked_as,
            },
        )

        def keep() -> Session:
            self._store.open_session(record, artifacts)
            return self._session(record, site, course, request)

        return self.sessions.admit(keep)

    def _run(self, site: Site, wanted: schemas.SensorIn, request: schemas.SessionIn) -> Run:
        """Return what a session localizes with on the current map of its site."""
        version = site.require_map()
        sensor = chosen(self.sites, site, wanted, self._settings)
        tolerance_m, backend = site.config.wall_tolerance_m, self._backend()
        return localizing(site, version, tolerance_m, sensor, request, backend)

    def _restored(self, site: Site, request: schemas.SessionIn, document: dict[str, Any]) -> Run:
        return restored(document, site, request, self._archive, self._backend())

    def _check_size(self, request: schemas.SessionIn) -> None:
        most = self._settings.max_particles
        if request.particles > most:
            message = f"particles must be at most {most}, not {request.particles}"
            raise homsense.InvalidConfigurationError(message, "particles")
        if request.adaptive is not None and request.adaptive.most > most:
            message = f"adaptive.most must be at most {most}, not {request.adaptive.most}"
            raise homsense.InvalidConfigurationError(message, "adaptive.most")

    def delete_device(self, site_name: str, device: str) -> int:
        """Delete all scans of a device; the complex is as if they had never been."""
        site = self.sites.get(site_name)
        return self.sites.delete_device(site, self._names.device(device))

    def move_session(self, name: str) -> Session:
        """Let a session go on with the current map of its site."""
        return self._awake(name, self._moved)[0]

    def _moved(self, session: Session) -> Session:
        site, before = session.site, session.run.sensor
        wanted = schemas.SensorIn(
            type=before.kind, hops=list(before.hops) or None, expected=before.expected
        )
        run = self._run(site, wanted, _request(session.record))
        session.migrate(run, *run_document(run, self._archive))
        return session

    def take_steps(
        self,
        name: str,
        steps: Sequence[schemas.StepIn],
        answer: Callable[[Session, Fix], Answer],
    ) -> Answer:
        """Apply steps to a session and answer with what follows from the last; all is on disk."""
        landmark_key = self.sessions.get(name).site.config.landmark_key
        return self.take(name, [self._step(step, landmark_key) for step in steps], answer)

    def take(
        self, name: str, steps: list[Step], answer: Callable[[Session, Fix], Answer]
    ) -> Answer:
        """Apply steps as `take_steps` does, once they are values."""

        def apply(session: Session) -> Answer:
            return session.apply(steps, partial(answer, session), session.site.receive)

        with self.watch("step"):
            answered, session = self._awake(name, apply)
        if session.contributes:
            self.sites.catch_up(session.site)
        return answered

    def answer(self, name: str, answer: Callable[[Session, Fix], Answer]) -> Answer:
        """Answer with what follows from the latest step of a session."""
        session = self.sessions.get(name)
        return session.answered(partial(answer, session))

    def take_again(
        self,
        name: str,
        seq: int,
        readings: tuple[StoredReading, ...],
        answer: Callable[[Session, Fix], Answer],
    ) -> Answer:
        """Answer a scan that was taken before as it was answered then."""

        def repeat(session: Session) -> Answer:
            return session.apply_again(seq, readings, partial(answer, session))

        return self._awake(name, repeat)[0]

    def heard(
        self, name: str, landmarks: list[str | schemas.ReadingIn]
    ) -> tuple[StoredReading, ...]:
        """Return what a device has heard as the site of its session keeps it."""
        landmark_key = self.sessions.get(name).site.config.landmark_key
        return self._names.readings(schemas.readings(landmarks), landmark_key)

    def bindings(self) -> list[Binding]:
        """Return which devices stream into which sessions."""
        return self._store.bindings()

    def bind(self, binding: Binding) -> None:
        """Let a device stream into a session, and no longer into another."""
        self._store.bind(binding)

    def _awake(self, name: str, act: Callable[[Session], Answer]) -> tuple[Answer, Session]:
        """Do something with a session that is in memory as long as that takes."""
        while True:
            session = self.sessions.get(name)
            try:
                return act(session), session
            except RestingError:
                continue

    def _wake(self, record: SessionRecord) -> Session:
        """Return a session as it was before a restart."""
        site, request = self.sites.get(record.site), _request(record)
        run = self._restored(site, request, record.document["run"])
        session = self._session(record, site, Course.begun(run, record.document["seed"]), request)
        session.resume()
        return session

    def _session(
        self, record: SessionRecord, site: Site, course: Course, request: schemas.SessionIn
    ) -> Session:
        restore = partial(self._restored, site, request)
        means = Means(self._store, restore, self._backend, self.watch, self._turn)
        return Session(record, site, course, means)

    def register(self, name: str) -> Registering:
        """Begin to place the crowd of a site on its map, if that is not known."""
        site = self.sites.get(name)
        site.registering.refresh(self.sites.crowd(site))
        return site.registering

    def rank_floors(self, name: str, candidates: Sequence[str]) -> None:
        """Begin to place the crowd of a site on the maps of several, if that is not known."""
        site = self.sites.get(name)
        maps = {other: self.sites.get(other).require_map() for other in candidates}
        site.ranking_floors.refresh(FloorsQuestion(self.sites.crowd(site), maps))

    def _step(self, wire: schemas.StepIn, landmark_key: str) -> Step:
        heard = self._names.readings(schemas.readings(wire.landmarks or []), landmark_key)
        return Step(wire.seq, wire.seconds(), wire.motion(), heard)

    def _stored(self, scan: schemas.ScanIn | schemas.DroppedScan) -> StoredScan:
        if isinstance(scan, schemas.DroppedScan):
            raise ValueError(scan.reason)  # noqa: TRY004 - the content is wrong, not our type
        return scan.to_stored(self._settings.max_landmarks_per_scan)


def _request(record: SessionRecord) -> schemas.SessionIn:
    return schemas.SessionIn.model_validate_json(record.document["request"])
