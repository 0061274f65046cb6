"""How well places explain a measurement: P(z|x) (Algorithm 1, line 12; section VI)."""

import copy
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from homsense.backend import Backend
from homsense.code_map import CodeMap
from homsense.errors import InvalidInputError
from homsense.noise import Noise

FloatArray = NDArray[np.float64]

MAX_COUNT = 1_000_000
BLUR_M = 4.0
"""With it the 90 % region held the truth in about 90 % of the steps of simulated robots."""

_REMEMBERED = 16


class Likelihood(Protocol):
    """What the localizer asks of a sensor model."""

    @property
    def code_map(self) -> CodeMap:
        """Places that explain alike."""
        ...

    @property
    def correlation_m(self) -> float:
        """Way after which the error is new, metres."""
        ...

    @property
    def blur_m(self) -> float:
        """How far off, by an axis, places may be beyond what the likelihood tells, metres."""
        ...

    def run_by(self, backend: Backend) -> "Likelihood":
        """Return the same likelihood on another backend."""
        ...

    def __call__(self, measurement: Any, /) -> FloatArray:  # noqa: ANN401 - each has its own
        """Return the binary logarithm of the likelihood for each code, at most 0."""
        ...


class CodeLikelihood:
    """How well each code explains measured counts.

    Parameters
    ----------
    code_map : CodeMap
        What is expected where.
    noise : Noise
        The error model.
    """

    def __init__(self, code_map: CodeMap, noise: Noise) -> None:
        self.code_map = code_map
        self.correlation_m = noise.correlation_m
        self.blur_m = BLUR_M
        self._n_levels = noise.n_levels(code_map.n_fields)
        self._weigh = lru_cache(_REMEMBERED)(noise.weigher(code_map.expected))

    def run_by(self, backend: Backend) -> Self:  # noqa: ARG002 - it has no hot loop
        """Return the same likelihood on another backend.

        Parameters
        ----------
        backend : Backend
            Of no use here.

        Returns
        -------
        CodeLikelihood
            This one.
        """
        return self

    def __call__(self, counts: Sequence[float]) -> FloatArray:
        """Weigh a measurement once for each code.

        Parameters
        ----------
        counts : sequence of float
            Measured counts, one for each neighborhood, in [0, 1e6].

        Returns
        -------
        ndarray, shape (n_codes,), float64
            Binary logarithms, at most 0; a place that is not free explains nothing.

        Raises
        ------
        InvalidInputError
            If the number of counts differs from that of the neighborhoods, or a count is out of
            range.
        """
        if len(counts) != self._n_levels:
            message = f"{self._n_levels} counts are expected, not {len(counts)}"
            raise InvalidInputError(message, "counts")
        for count in counts:
            if not 0 <= count <= MAX_COUNT:
                message = f"a count must be in [0, {MAX_COUNT}], not {count}"
                raise InvalidInputError(message, "counts")
        return self._weigh(tuple(counts))


class JointMeasurement(NamedTuple):
    """What two sensors have measured at the same place; either may have nothing to say.

    Parameters
    ----------
    first : Any, optional
        Of the first sensor.
    second : Any, optional
        Of the second one.
    """

    first: Any = None
    second: Any = None


class JointLikelihood:
    """Two sensors that know their places from the same crowd, each weighed at its own pace.

    Parameters
    ----------
    first : Likelihood
        Its codes are used, and its correlation length.
    second : Likelihood
        Looked up where each code of the first occurs for the first time; of a correlation length
        no shorter.

    Notes
    -----
    The localizer raises a likelihood to ``way / correlation_m``, so the second is raised to the
    ratio of the lengths here. That is exact while scans are no farther apart than the first
    length; beyond it the second counts for less than it could.

    Both owe their errors to the places of the same crowd, so they are as good as one measurement:
    when both have measured, their mean counts.
    """

    def __init__(self, first: Likelihood, second: Likelihood) -> None:
        self.code_map = first.code_map
        self.correlation_m = first.correlation_m
        self.blur_m = max(first.blur_m, second.blur_m)
        self._first, self._second = first, second
        self._share = min(1.0, first.correlation_m / second.correlation_m)
        known, cell = np.unique(first.code_map.codes, return_index=True)
        self._code = np.zeros(len(first.code_map.expected), np.intp)
        self._code[known] = second.code_map.codes[cell]

    def run_by(self, backend: Backend) -> Self:
        """Return the same likelihood on another backend.

        Parameters
        ----------
        backend : Backend
            What runs the hot loops of both sensors.

        Returns
        -------
        JointLikelihood
            Equal to this one.
        """
        same = copy.copy(self)
        vars(same).update(_first=self._first.run_by(backend), _second=self._second.run_by(backend))
        return same

    def __call__(self, measurement: JointMeasurement) -> FloatArray:
        """Weigh what both have measured, once for each code of the first.

        Parameters
        ----------
        measurement : JointMeasurement
            At least one is there.

        Returns
        -------
        ndarray, shape (n_codes,), float64
            Binary logarithms, at most 0.
        """
        bits = np.zeros(len(self.code_map.expected))
        if measurement.first is not None:
            bits += self._first(measurement.first)
        if measurement.second is not None:
            bits += self._share * self._second(measurement.second)[self._code]
        is_alone = measurement.first is None or measurement.second is None
        return bits if is_alone else 0.5 * bits
