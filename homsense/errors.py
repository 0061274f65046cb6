"""The errors that the method raises; every one derives from `HomsenseError`."""

import math

LEAST = 1e-9
"""What a positive parameter has to be at least."""


class HomsenseError(Exception):
    """The root of the tree; never raised itself."""


class InvalidInputError(HomsenseError, ValueError):
    """A documented precondition was broken by the caller.

    Parameters
    ----------
    message : str
        What is wrong, for a person.
    field : str, optional
        The offending input in dotted notation, such as ``features.3.geometry``.
    """

    def __init__(self, message: str, field: str | None = None) -> None:
        super().__init__(message)
        self.field = field


class InvalidScanError(InvalidInputError):
    """A reading or an observation is malformed."""


class InvalidComplexError(InvalidInputError):
    """A simplex, a hop count or a degree makes no sense for this complex."""


class InvalidMapError(InvalidInputError):
    """A map is malformed, or leaves no free space."""


class InvalidConfigurationError(InvalidInputError):
    """A parameter of the localizer is out of its range."""


class ComputationLimitError(HomsenseError):
    """An exact answer exists but costs more than the caller allowed."""


def check_positive(field: str, number: float) -> None:
    """Refuse a parameter that is not positive.

    Parameters
    ----------
    field : str
        Its name in dotted notation.
    number : float
        What it is.

    Raises
    ------
    InvalidConfigurationError
        If the number is not finite or below `LEAST`.
    """
    if not LEAST <= number < math.inf:
        *_, name = field.split(".")
        message = f"{name} must be positive, at least {LEAST:g}, not {number}"
        raise InvalidConfigurationError(message, field)
