"""How well expected counts explain a measured one: P(z|x) (Algorithm 1, line 12; section VI)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from homsense.code_map import CodeMap
from homsense.errors import InvalidConfigurationError, InvalidInputError
from homsense.exact import exp, log2

FloatArray = NDArray[np.float64]

MAX_COUNT = 1_000_000
_NO_MATCH, _LEAST = 1e3, 1e-300
_REMEMBERED = 512


@dataclass(frozen=True, slots=True)
class CountNoise:
    """The error of the homological sensor.

    The error is a random field over space, not fresh noise at each scan: devices that stand close
    together err alike. A measurement taken after a short way repeats the one before, so its
    likelihood is raised to ``way / correlation_m``, at most 1.

    Parameters
    ----------
    sigma : float, default 1.5
        Standard deviation of a count, inflated, in holes.
    floor : float, default 0.02
        Share of measurements that say nothing, in [0, 1).
    correlation_m : float, default 150.0
        Way after which the error is new, metres.

    Raises
    ------
    InvalidConfigurationError
        If a parameter is out of range.
    """

    sigma: float = 1.5
    floor: float = 0.02
    correlation_m: float = 150.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.sigma) and self.sigma > 0.0):
            message = f"sigma must be positive, not {self.sigma}"
            raise InvalidConfigurationError(message, "sigma")
        if not 0.0 <= self.floor < 1.0:
            message = f"floor must be in [0, 1), not {self.floor}"
            raise InvalidConfigurationError(message, "floor")
        if not (math.isfinite(self.correlation_m) and self.correlation_m > 0.0):
            message = f"correlation_m must be positive, not {self.correlation_m}"
            raise InvalidConfigurationError(message, "correlation_m")


class CodeLikelihood:
    """How well each code explains measured counts: near times far, each a floored Gaussian.

    Parameters
    ----------
    code_map : CodeMap
        Expected counts.
    noise : CountNoise
        The error model.
    """

    def __init__(self, code_map: CodeMap, noise: CountNoise) -> None:
        self._n_levels = code_map.n_levels
        self._of_level = lru_cache(_REMEMBERED)(partial(_level_likelihood, code_map, noise))

    def __call__(self, counts: Sequence[int]) -> FloatArray:
        """Weigh a measurement once for each code.

        Parameters
        ----------
        counts : sequence of int
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
        total = self._of_level(0, counts[0])
        for level, count in enumerate(counts[1:], start=1):
            total = total + self._of_level(level, count)
        return total


def _level_likelihood(code_map: CodeMap, noise: CountNoise, level: int, count: int) -> FloatArray:
    apart = (code_map.expected[:, level] - float(count)) / noise.sigma
    match = exp(-0.5 * np.square(np.nan_to_num(apart, nan=_NO_MATCH)))
    return log2(np.maximum(noise.floor + (1.0 - noise.floor) * match, _LEAST))
