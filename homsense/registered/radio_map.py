"""What is heard where: the radio map that a registered crowd has made without any label.

For each block of the map and each landmark: how often scans near it hear the landmark, and how
loud. All sums are of whole numbers, so they are exact in any order.
"""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from homsense.audibility import Audible
from homsense.backend import Backend
from homsense.exact import exp, log2
from homsense.registered.complex import RegisteredComplex, Sighting
from homsense.scalar import LN_2

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

WIDTH_SHARE, CUT_SHARE = 0.2, 1.2
"""Of the reach: how far away a scan counts for 1/e, and from where on for nothing."""

NOBODY = 0.02
"""Scans in every block that hear any landmark as often, and as loud, as is usual anywhere."""

EVENNESS = 16.0
"""Scans differ in how much they hear at all: a gamma distribution of this shape, a quarter."""

LEAST_VARIANCE_DB2 = 16.0
_ONE = 1 << 16


class RadioMap(NamedTuple):
    """What a crowd under one placement hears in the blocks of a map.

    Parameters
    ----------
    audible : Audible
        Where each landmark can be heard.
    unheard_of : ndarray, shape (B,), float64
        What it tells that a landmark is heard which nobody has heard near the block, bits.
    amount : ndarray, shape (B,), float64
        How many landmarks are heard there.
    usual_db, usual_bits_per_db2 : ndarray, shape (L,), float64
        How loud each landmark is anywhere, and what a deviation from that costs.
    near : ndarray, shape (B,), float64
        How many scans count there.
    """

    audible: Audible
    unheard_of: FloatArray
    amount: FloatArray
    usual_db: FloatArray
    usual_bits_per_db2: FloatArray
    near: FloatArray

    @classmethod
    def of(cls, found: RegisteredComplex, middles: FloatArray) -> Self:
        """Return the radio map of a crowd.

        Parameters
        ----------
        found : RegisteredComplex
            The crowd, under its best placement.
        middles : ndarray, shape (B, 2), float64
            Of the blocks, metres.

        Returns
        -------
        RadioMap
            A landmark is heard as often as by the scans near the block, each weighed by an
            exponential kernel, and as loud as in those that hear it, give or take their variance.
        """
        index, n_landmarks = found.index, len(found.index.column)
        counts = _counts(found, middles)
        near = np.asarray(counts.sum(axis=0), np.float64) / _ONE
        height = np.asarray(found.hearing.heights_db(index.amount), np.int64)
        shape = n_landmarks, found.size
        heard = [csr_array((height**power, index.scan, index.start), shape) for power in range(3)]
        usual = [np.asarray(of_power.sum(axis=1), np.float64) for of_power in heard]
        summed = [csr_array(of_power @ counts) for of_power in heard]
        for of_power in summed:
            of_power.sort_indices()
        start, block = summed[0].indptr.astype(np.int64), summed[0].indices.astype(np.int32)
        of = np.repeat(np.arange(n_landmarks), np.diff(start))
        n, db, db2 = (of_power.data / _ONE for of_power in summed)

        usual_db = usual[1] / usual[0]
        usual_db2 = np.maximum(usual[2] / usual[0] - np.square(usual_db), LEAST_VARIANCE_DB2)
        height_db = (db + NOBODY * usual_db[of]) / (n + NOBODY)
        square_db2 = (db2 + NOBODY * (usual_db2 + np.square(usual_db))[of]) / (n + NOBODY)
        variance_db2 = np.maximum(square_db2 - np.square(height_db), LEAST_VARIANCE_DB2)

        anyone = NOBODY * usual[0].sum() / (found.size * n_landmarks)
        nobody_near = anyone / (near + NOBODY)
        hears = (n + anyone) / (near[block] + NOBODY)
        more = np.bincount(block, hears - nobody_near[block], len(middles))
        unheard_of = log2(nobody_near)
        bits = log2(hears / np.sqrt(variance_db2 / usual_db2[of])) - unheard_of[block]
        audible = Audible(
            start,
            block,
            bits.astype(np.float32),
            height_db.astype(np.float32),
            (0.5 / (LN_2 * variance_db2)).astype(np.float32),
        )
        amount = n_landmarks * nobody_near + more
        return cls(audible, unheard_of, amount, usual_db, 0.5 / (LN_2 * usual_db2), near)

    def bits(self, sighting: Sighting, backend: Backend) -> FloatArray:
        """Return how well each block explains what a scan hears, and what it does not.

        Parameters
        ----------
        sighting : Sighting
            Of the complex of this map.
        backend : Backend
            What adds up.

        Returns
        -------
        ndarray, shape (B,), float64
            Binary log-likelihood above some constant, if landmarks were independent: each is
            heard once with the Poisson rate of the block times how much the scan hears at all,
            which is integrated out.
        """
        landmark = np.array(sighting.landmark, np.int64)
        height_db = np.array(sighting.height_db, np.float64)
        off_db = height_db - self.usual_db[landmark]
        above = self.usual_bits_per_db2[landmark] * (off_db * off_db)
        told = backend.heard(self.audible, landmark, height_db, above, len(self.near))
        told += len(landmark) * self.unheard_of
        told -= (len(landmark) + EVENNESS) * log2(self.amount + EVENNESS)
        return told


def _counts(found: RegisteredComplex, middles: FloatArray) -> csr_array:
    """Return how much each scan counts in each block, in units of `_ONE`."""
    pairs = cKDTree(found.xy).sparse_distance_matrix(
        cKDTree(middles), CUT_SHARE * found.reach_m, output_type="ndarray"
    )
    scan, block = pairs["i"], pairs["j"]
    apart_m = np.sqrt(np.square(middles[block] - found.xy[scan]).sum(axis=1))
    weight = np.rint(_ONE * exp(-apart_m / (WIDTH_SHARE * found.reach_m))).astype(np.int64)
    return csr_array((weight, (scan, block)), (found.size, len(middles)))
