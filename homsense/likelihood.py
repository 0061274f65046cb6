"""How well expected counts explain a measured one: P(z|x) (Algorithm 1, line 12; section VI)."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from homsense.code_map import CodeMap
from homsense.errors import InvalidInputError
from homsense.noise import Noise

FloatArray = NDArray[np.float64]

MAX_COUNT = 1_000_000
_REMEMBERED = 16


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
        self._n_levels = noise.n_levels(code_map.n_fields)
        self._bits = lru_cache(_REMEMBERED)(lambda counts: noise.bits(counts, code_map.expected))

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
        bits: FloatArray = self._bits(tuple(counts))
        return bits
