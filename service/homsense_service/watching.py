"""Stages whose time somebody may want to know."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

Watch = Callable[[str], AbstractContextManager[object]]
"""Takes the name of a stage, returns a context that lasts as long."""


def unwatched(_stage: str) -> AbstractContextManager[object]:
    """Return a context that takes no notice."""
    return nullcontext()
