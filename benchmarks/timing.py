"""What a question costs."""

import time
from collections.abc import Callable
from typing import TypeVar

Answer = TypeVar("Answer")


def best_of(tries: int, question: Callable[[], Answer]) -> tuple[float, Answer]:
    """Return the CPU seconds of the best of some tries, and the last answer."""
    best = float("inf")
    for _ in range(tries):
        started = time.thread_time()
        answer = question()
        best = min(best, time.thread_time() - started)
    return best, answer
