"""Laws of the inbox: whatever the network does, a session gets every input once, in order."""

from dataclasses import dataclass

import numpy as np
import pytest
from homsense_service.bridge import encodings
from homsense_service.bridge.inbox import MOST_WAITING, PATIENCE_S, Inbox
from homsense_service.bridge.inputs import Deltas, Input, Readings, Scan
from homsense_service.records import StoredReading
from homsense_service.runs import Step
from hypothesis import given
from hypothesis import strategies as st

from homsense import Delta, HomsenseError, ImuSample, Velocity, preintegrate

PAUSE_S = 0.1


@dataclass(frozen=True)
class Sent:
    """What a device has sent: motions east of 1, 2, 4... and scans, in messages."""

    messages: list[Input]
    scans: list[int]
    last: int

    @property
    def motions(self) -> int:
        return self.last - len(self.scans)


def deltas(first: int, count: int, length_m: float = 1.0) -> Deltas:
    return Deltas(first, np.full((count, 3), (length_m, 0.0, 0.0)), np.full(count, 0.01))


def scan(number: int) -> Scan:
    return Scan(number, (StoredReading(f"heard at {number}"),))


@st.composite
def sent(draw: st.DrawFn) -> Sent:
    messages: list[Input] = []
    scans, number = [], 1
    for size in draw(st.lists(st.integers(0, 12), min_size=1, max_size=12)):
        if size == 0:
            messages.append(scan(number))
            scans.append(number)
        else:
            messages.append(deltas(number, size))
        number = messages[-1].following
    return Sent(messages, scans, number - 1)


def way_m(steps: list[Step]) -> float:
    lengths = [step.motion.forward_m for step in steps if isinstance(step.motion, Delta)]
    return float(sum(lengths))


def drained(inbox: Inbox, now_s: float) -> tuple[list[Step], int]:
    plan = inbox.plan(now_s)
    if plan.steps:
        inbox.taken(plan.steps, now_s)
    return plan.steps, plan.lost


@given(sent(), st.data())
def test_order_repetition_and_grouping_change_nothing(given_by: Sent, data: st.DataObject) -> None:
    messages = data.draw(st.permutations(given_by.messages * 2))
    inbox, steps, lost = Inbox(0, None, PAUSE_S), list[Step](), 0
    for message in messages:
        assert inbox.put(message, 0.0)
        if data.draw(st.booleans()):
            taken, missing = drained(inbox, 0.01)
            steps, lost = steps + taken, lost + missing
    taken, missing = drained(inbox, 10.0)
    steps, lost = steps + taken, lost + missing
    assert lost == 0
    assert way_m(steps) == pytest.approx(given_by.motions)
    assert [step.seq for step in steps if step.readings] == given_by.scans
    assert [step.seq for step in steps] == sorted({step.seq for step in steps})
    assert inbox.through == given_by.last
    for at in given_by.scans:
        before = [step for step in steps if step.seq <= at]
        assert way_m(before) == pytest.approx(at - sum(s <= at for s in given_by.scans))


@given(sent(), st.data())
def test_what_is_lost_is_counted_and_guessed(given_by: Sent, data: st.DataObject) -> None:
    arrived = data.draw(st.lists(st.sampled_from(given_by.messages), unique_by=id))
    last = max((m.following for m in arrived), default=1) - 1
    inbox = Inbox(0, None, PAUSE_S)
    for message in arrived:
        inbox.put(message, 0.0)
    early = inbox.plan(PATIENCE_S / 2)
    assert early.lost == 0
    steps, lost = drained(inbox, 10.0)
    assert lost == last - sum(m.following - m.first for m in arrived)
    known = sum(len(m.motions) for m in arrived if isinstance(m, Deltas))
    assert known - 1e-9 <= way_m(steps) <= known + lost + 1e-9
    assert inbox.through == last or not steps


@given(sent())
def test_a_plan_that_was_not_carried_out_is_made_again(given_by: Sent) -> None:
    inbox = Inbox(0, None, PAUSE_S)
    for message in given_by.messages:
        inbox.put(message, 0.0)
    assert inbox.plan(1.0) == inbox.plan(1.0)


@given(sent(), st.integers(0, 40))
def test_what_is_on_disk_is_left_out(given_by: Sent, through: int) -> None:
    inbox = Inbox(through, None, PAUSE_S)
    for message in given_by.messages:
        inbox.put(message, 0.0)
    steps, _ = drained(inbox, 10.0)
    scans = sum(at > through for at in given_by.scans)
    rest = max(0, given_by.last - through)
    assert way_m(steps) == pytest.approx(rest - scans)
    assert all(step.seq > through for step in steps)


def test_a_single_motion_reaches_the_filter_bit_for_bit() -> None:
    inbox = Inbox(0, None, PAUSE_S)
    moved = (0.1 + 0.2, -0.3, 0.7)
    inbox.put(Deltas(1, np.array([moved]), np.array([1.0])), 0.0)
    inbox.put(scan(2), 0.0)
    (step,) = inbox.plan(0.0).steps
    assert step == Step(2, 1.0, Delta(*moved, 1.0), (StoredReading("heard at 2"),))


def test_a_hole_makes_the_motion_doubtful() -> None:
    inbox = Inbox(0, 5.0, PAUSE_S)
    inbox.put(deltas(1, 10), 0.0)
    inbox.put(deltas(31, 10), 0.0)
    plan = inbox.plan(1.0)
    assert plan.lost == 20
    assert [step.seq for step in plan.steps] == [10, 30, 40]
    guessed = plan.steps[1].motion
    assert isinstance(guessed, Delta)
    assert guessed.forward_m == pytest.approx(20.0)
    assert guessed.std is not None
    assert guessed.std[0] == pytest.approx(20.0)
    assert plan.steps[-1].t == pytest.approx(5.4)


def test_a_hole_in_readings_is_filled_with_the_same_forces() -> None:
    inbox = Inbox(0, None, PAUSE_S)
    inbox.put(Readings(1, (ImuSample(0.01, 1.0, 0.0, 0.5),) * 5), 0.0)
    inbox.put(Readings(2006, (ImuSample(0.01, 1.0, 0.0, 0.5),) * 5), 0.0)
    first, guessed, _ = inbox.plan(1.0).steps
    assert first.motion == (ImuSample(0.01, 1.0, 0.0, 0.5),) * 5
    assert isinstance(guessed.motion, tuple)
    pieces = [sample for sample in guessed.motion if isinstance(sample, ImuSample)]
    assert sum(sample.dt_s for sample in pieces) == pytest.approx(20.0)
    assert all(sample.dt_s <= 10.0 for sample in pieces)


def test_motion_alone_makes_a_step_only_now_and_then() -> None:
    inbox = Inbox(0, None, PAUSE_S)
    inbox.put(deltas(1, 1), 0.0)
    assert [step.seq for step in drained(inbox, 0.0)[0]] == [1]
    inbox.put(deltas(2, 1), 0.01)
    plan = inbox.plan(0.01)
    assert plan.steps == []
    assert plan.wake_s == pytest.approx(PAUSE_S)
    inbox.put(deltas(3, 1), 0.02)
    assert [step.seq for step in drained(inbox, PAUSE_S)[0]] == [3]


def test_what_piles_up_is_bounded() -> None:
    inbox = Inbox(0, None, PAUSE_S)
    for number in range(1, MOST_WAITING + 1):
        assert inbox.put(deltas(number, 1), 0.0)
    assert not inbox.put(deltas(MOST_WAITING + 1, 1), 0.0)
    assert inbox.plan(1.0).lost == 1


@given(st.integers(1, 2**52), st.sampled_from([1e-3, 1.0, 1e6]))
def test_absurd_numbers_do_no_harm(number: int, length_m: float) -> None:
    inbox = Inbox(0, None, PAUSE_S)
    inbox.put(deltas(1, 1, length_m), 0.0)
    inbox.put(deltas(number, 1000, length_m), 0.0)
    inbox.put(Readings(number + 2000, (ImuSample(0.01, 1.0, 0.0, 0.5),) * 5), 0.0)
    for step in inbox.plan(10.0).steps:
        if isinstance(step.motion, Delta):
            step.motion.checked()
        else:
            preintegrate([s for s in step.motion if isinstance(s, ImuSample)], Velocity())


@given(
    st.binary(max_size=200) | st.integers(0, 6).flatmap(lambda n: st.binary(min_size=32 * n)),
    st.sampled_from([encodings.DELTA, encodings.IMU, encodings.JSON, "", "zenoh/bytes"]),
)
def test_any_bytes_are_motion_or_a_value_error(payload: bytes, encoding: str) -> None:
    try:
        moving = encodings.motion_of(encoding, payload, 1)
    except (ValueError, HomsenseError):
        return
    inbox = Inbox(0, None, PAUSE_S)
    inbox.put(moving, 0.0)
    (step,) = inbox.plan(1.0).steps
    assert step.seq == moving.following - 1
    if isinstance(step.motion, Delta):
        step.motion.checked()
