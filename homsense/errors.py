"""The errors that the method raises; every one derives from `HomsenseError`."""


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
