"""What belongs together is done in order, one at a time; the rest side by side."""

import threading
from functools import partial

from homsense_service.bridge.lanes import Lane, Workers

COUNT, LANES = 300, 5


def test_each_lane_keeps_its_order_and_nothing_is_lost() -> None:
    workers = Workers(3, "test")
    done: list[list[int]] = [[] for _ in range(LANES)]
    left = threading.Semaphore(0)

    def note(lane: int, number: int) -> None:
        done[lane].append(number)
        left.release()

    lanes = [Lane(workers) for _ in done]
    for number in range(COUNT):
        for at, lane in enumerate(lanes):
            assert lane.post(partial(note, at, number))
    for _ in range(COUNT * LANES):
        assert left.acquire(timeout=10.0)
    workers.close()
    assert done == [list(range(COUNT))] * LANES


def test_jobs_wait_for_workers_and_a_failure_ends_none() -> None:
    workers = Workers(2, "test")
    meet = threading.Barrier(3)
    ended = threading.Event()

    def wait() -> None:
        meet.wait(10.0)

    def fail() -> None:
        raise RuntimeError

    for job in (wait, wait, fail, ended.set):
        workers.submit(job)
    assert not ended.is_set()
    meet.wait(10.0)
    assert ended.wait(10.0)
    workers.close()


def test_closing_wakes_the_idle() -> None:
    before = threading.active_count()
    Workers(4, "test").close()
    assert threading.active_count() == before
