"""Changes that are made only to what the caller has seen."""

from collections.abc import Callable

from homsense_service.errors import PreconditionError

Expected = Callable[[str | None], bool]
"""Tells whether a thing may have this version; None when it is not there."""


def whatever(_version: str | None) -> bool:
    """Expect nothing."""
    return True


def check(version: str | None, expected: Expected) -> None:
    """Raise `PreconditionError` unless a version is expected."""
    if not expected(version):
        found = "there is none" if version is None else f"it is {version!r} now"
        message = f"it is not the version that was asked for: {found}"
        raise PreconditionError(message)
