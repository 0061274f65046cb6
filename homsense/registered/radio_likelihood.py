"""From what a scan hears to how likely it was made at each place.

The radio map of a registered crowd weighs what is heard and what is not. Landmarks are not
independent, least of all in a dense mall, so each has a share of its word only; how much is
learnt from the crowd itself, half of its walks placed among the other half. Where nobody has been
the radio map does not know what there is to hear: there a scan is as likely as anywhere, by how
much it resembles those of places where others have been.
"""

import math
from collections.abc import Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from homsense.backend import Backend
from homsense.code_map import NOWHERE
from homsense.exact import exp, log2
from homsense.free_space import FreeSpace
from homsense.registered.complex import RegisteredComplex, Sighting
from homsense.registered.place import NOTHING_BITS, PlaceLikelihood
from homsense.registered.radio_map import RadioMap
from homsense.scalar import LN_2, exp2
from homsense.stages import cells_at

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

SHARES = 2.0 ** (-0.5 * np.arange(15))
"""Of its word that a landmark may have."""

UNLEARNT_SHARE = 0.0625
SEEN = 0.05
"""So many scans near a block tell half of what there is to hear."""

WRONG = 0.02
"""Share of the crowd's own places to reckon with as wrong."""

CORRELATION_SHARE = 0.8
"""Of the reach: way after which the error is new."""

_ASKED = 200
_LEAST = 2.0**-1000


class RadioMapLikelihood(PlaceLikelihood):
    """How well each block of a map explains what a scan hears.

    Where a crowd may lie in several ways, they are averaged with their probabilities until the
    data decide.

    Parameters
    ----------
    complex_ : RegisteredComplex
        The crowd.
    free_space : FreeSpace
        Where devices are looked for, in blocks of a sixth of the reach.
    backend : Backend, optional
        What adds up; the fastest by default. Results do not depend on it.
    share : float, optional
        How much of its word each landmark has, in (0, 1]; learnt from the crowd when absent.
    """

    def __init__(
        self,
        complex_: RegisteredComplex,
        free_space: FreeSpace,
        backend: Backend | None = None,
        share: float | None = None,
    ) -> None:
        super().__init__(complex_, free_space, backend)
        self.correlation_m = CORRELATION_SHARE * complex_.reach_m
        middles = self.code_map.expected[1:]
        self._radio = tuple(RadioMap.of(placed, middles) for placed in complex_.placed)
        self.share = share or self._best_share()

    def _best_share(self) -> float:
        told = self._told_by_share
        return float(SHARES[told.argmax()]) if len(told) else UNLEARNT_SHARE

    @cached_property
    def information_bits(self) -> float:
        """What a scan tells about its place, bits above the mean over the map.

        The mean over some scans of the crowd, each compared with half of the walks.
        """
        return float(self._told_by_share.max(initial=0.0))

    def __call__(self, sighting: Sighting) -> FloatArray:
        """Weigh a scan once for each block.

        Parameters
        ----------
        sighting : Sighting
            What it hears, of the same complex.

        Returns
        -------
        ndarray, shape (n_codes,), float64
            Binary logarithms, 0 for the best block; a place that is not free explains nothing.

        Raises
        ------
        InvalidInputError
            If the sighting is of another complex.
        """
        if sighting.scan and not sighting.landmark:  # kept before there were radio maps
            return super().__call__(sighting)
        self.check(sighting)
        told = [radio.bits(sighting, self.backend) for radio in self._radio]
        best, shown = max(bits.max() for bits in told), self._shown(self.complex, sighting)
        probabilities = self.complex.registration.probabilities[: len(told)]
        mean = sum(
            probability * self._mixed(radio, self.share * (bits - best), shown)
            for probability, radio, bits in zip(probabilities, self._radio, told, strict=True)
        )
        bits = log2(np.maximum(mean, _LEAST))
        return np.concatenate([[NOTHING_BITS], bits - bits.max()])

    def _shown(self, crowd: RegisteredComplex, sighting: Sighting) -> float:
        """Return how much likelier the resemblance is where the crowd has been."""
        return exp2(float(crowd.coverage_nats[sighting.highest]) / LN_2)

    def _mixed(self, radio: RadioMap, bits: FloatArray, shown: float) -> FloatArray:
        """Return the likelihood of each block, where it is not known what there is to hear too."""
        likelihood = exp(LN_2 * bits)
        known = radio.near / (radio.near + SEEN)
        mass = known * self.code_map.sizes[1:]
        anywhere = _total(mass * likelihood) / max(_total(mass), _LEAST)
        return known * likelihood + (1.0 - known) * (anywhere / shown)

    @cached_property
    def _told_by_share(self) -> FloatArray:
        """What scans tell about their places if landmarks have each of `SHARES`, mean bits.

        Empty where no walk can be left out.
        """
        best, *_ = self.complex.placed
        halves = [best.walk % 2 == half for half in range(2)]
        told = [bits for half in halves if half.any() for bits in self._told_of(best, half)]
        return np.mean(told, axis=0) if told else np.zeros(0)

    def _told_of(self, crowd: RegisteredComplex, left_out: BoolArray) -> Iterator[list[float]]:
        others = crowd.of(~left_out)
        if not others.size:
            return
        radio = RadioMap.of(others, self.code_map.expected[1:])
        raster = self.code_map.free_space.grid.raster
        codes = self.code_map.codes[cells_at(raster, *crowd.xy.astype(np.float32).T)]
        some = np.flatnonzero(left_out & (codes != NOWHERE))
        for scan in some[:: max(1, 2 * len(some) // _ASKED)].tolist():
            sighting = others.compared(crowd.signatures[scan])
            bits, shown = radio.bits(sighting, self.backend), self._shown(others, sighting)
            bits -= bits.max()
            likelihoods = [self._mixed(radio, share * bits, shown) for share in SHARES]
            yield [self._gain(likelihood, int(codes[scan])) for likelihood in likelihoods]

    def _gain(self, likelihood: FloatArray, code: int) -> float:
        """Return how much more likely a scan is where it was made than anywhere, bits."""
        sizes = self.code_map.sizes[1:]
        mean = _total(sizes * likelihood) / _total(sizes)
        return math.log2((1.0 - WRONG) * likelihood[code - 1] / mean + WRONG)


def _total(numbers: FloatArray) -> float:
    """Return a sum that is added up in order, so that it has the same bits everywhere."""
    return float(np.cumsum(numbers)[-1])
