"""The events of a session and its snapshots, as bytes and back; no bit of a number is lost."""

import hashlib
import json
from typing import Any, NamedTuple
from zipfile import BadZipFile

import numpy as np

import homsense
from homsense.particles import Particles
from homsense.recovery import Doubt
from homsense_service.bundles import bundled, unbundled
from homsense_service.errors import StoreError
from homsense_service.own_motion import Motion, OwnMotion, Walked
from homsense_service.records import Event, Snapshot
from homsense_service.runs import Course, Fix, Run, Step
from homsense_service.sensors import Measured

_PARTICLES = Particles._fields


class Moved(NamedTuple):
    """A session goes on with another map.

    Parameters
    ----------
    run : dict
        Tells of the run.
    """

    run: dict[str, Any]


class Taken(NamedTuple):
    """A session has taken a step.

    Parameters
    ----------
    step : Step
        Without its readings, which are not kept.
    measured : Measured, optional
        What they were worth.
    digest : str, optional
        Of the state after it, when that was told.
    """

    step: Step
    measured: Measured | None
    digest: str | None


def fingerprint(step: Step) -> bytes:
    """Return a hash of all that a device gives with a step."""
    heard = [(r.landmark, r.rssi_dbm, r.age_s) for r in step.readings]
    text = json.dumps([step.t, _motion_document(step.motion), heard])
    return hashlib.blake2b(text.encode(), digest_size=8).digest()


def taken(course: Course, step: Step, given: bytes, *, told: bool) -> Event:
    """Return the event of a step.

    Parameters
    ----------
    course : Course
        After it.
    step : Step
        What was given.
    given : bytes
        Its fingerprint.
    told : bool
        Whether the device gets an answer for it.

    Returns
    -------
    Event
        For the journal.
    """
    fix = course.fix
    digest = fix.digest if told else None
    body = json.dumps([step.t, _motion_document(step.motion), _worth(fix.measured), digest])
    return Event(course.number, step.seq, given, body.encode())


def moved(course: Course, run: dict[str, Any]) -> Event:
    """Return the event of a move to another map."""
    return Event(course.number, course.fix.seq, b"", json.dumps(run).encode())


def read(event: Event) -> Taken | Moved:
    """Return what has happened.

    Raises
    ------
    StoreError
        If the event is damaged.
    """
    try:
        found = json.loads(event.body)
        if not event.fingerprint:
            return Moved(found)
        t, motion, worth, digest = found
        return Taken(Step(event.seq, t, _motion(motion)), _measured(worth), digest)
    except (ValueError, TypeError, KeyError) as error:
        message = f"event {event.number} of the journal is damaged: {error}"
        raise StoreError(message) from error


def snapshot(course: Course) -> Snapshot:
    """Return the state of a session for the store."""
    fix, state = course.fix, course.fix.state
    document = {
        "seq": fix.seq,
        "t": fix.t,
        "measured": _worth(fix.measured),
        "level": fix.level,
        "seed": state.seed,
        "tick": state.tick,
        "travel": state.travel,
        "doubt": state.doubt,
        "velocity": course.own_motion.velocity,
        "heading_rad": course.own_motion.heading_rad,
        "track": course.track,
        "seen": [*map(sorted, course.seen)],
        "digest": fix.digest,
    }
    return Snapshot(course.number, bundled(document, state.particles._asdict()))


def resumed(kept: Snapshot, run: Run) -> Course | None:
    """Return the session that a snapshot shows; None when it is damaged.

    Parameters
    ----------
    kept : Snapshot
        From `snapshot`.
    run : Run
        What the session localized with then.

    Returns
    -------
    Course or None
        Goes on as the session would have.
    """
    try:
        document, arrays = unbundled(kept.body)
        state = homsense.LocalizerState(
            document["seed"],
            document["tick"],
            Particles(*(np.asarray(arrays[name]) for name in _PARTICLES)),
            homsense.Travel(*document["travel"]),
            Doubt(*document["doubt"]),
        )
        measured = _measured(document["measured"])
        fix = Fix(document["seq"], document["t"], measured, document["level"], state, run)
        own_motion = OwnMotion(homsense.Velocity(*document["velocity"]), document["heading_rad"])
        track = homsense.Travel(*document["track"])
        seen = tuple(map(frozenset, document.get("seen", ())))
    except (ValueError, TypeError, KeyError, OSError, EOFError, BadZipFile):
        return None
    if fix.digest != document["digest"]:
        return None
    return Course(fix, kept.number, own_motion, track, seen)


def _motion_document(motion: Motion) -> list[Any]:
    if isinstance(motion, homsense.Delta):
        return ["delta", *motion]
    if isinstance(motion, Walked):
        return ["walked", *motion]
    return ["imu", *motion]


def _motion(document: list[Any]) -> Motion:
    kind, *rest = document
    if kind == "delta":
        forward_m, left_m, turn_rad, dt_s, std, covariance = rest
        return homsense.Delta(
            forward_m,
            left_m,
            turn_rad,
            dt_s,
            std=None if std is None else tuple(std),
            covariance=None if covariance is None else tuple(covariance),
        )
    if kind == "walked":
        return Walked(*rest)
    return tuple(homsense.ImuSample(*sample) for sample in rest)


def _worth(measured: Measured | None) -> list[Any] | None:
    if measured is None:
        return None
    return [measured.holes, measured.sighting, *map(sorted, measured.seen)]


def _measured(worth: list[Any] | None) -> Measured | None:
    if worth is None:
        return None
    holes, sighting, *seen = worth
    return Measured(
        None if holes is None else tuple(holes),
        None if sighting is None else homsense.Sighting(*map(tuple, sighting)),
        tuple(map(frozenset, seen)),
    )
