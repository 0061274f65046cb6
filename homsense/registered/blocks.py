"""A crowd under one placement, as the blocks of a map see it."""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from homsense.backend import Backend
from homsense.exact import exp
from homsense.registered.complex import RegisteredComplex
from homsense.resemblance import Nearby

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

KERNEL_SHARE, KERNEL_CUT = 1.0, 2.5
NOBODY = 2.0


class Blocks(NamedTuple):
    """What scans count for in which blocks.

    Parameters
    ----------
    nearby : Nearby
        The blocks near each scan.
    nothing : ndarray, shape (rings,), float64
        What no similarity tells, nats.
    total, silent : ndarray, shape (B,), float64
        Sums over the entries of each block: of the kernel, and of what no similarity tells.
    """

    nearby: Nearby
    nothing: FloatArray
    total: FloatArray
    silent: FloatArray

    @classmethod
    def of(cls, found: RegisteredComplex, middles: FloatArray) -> Self:
        """Return what the scans of a crowd count for.

        Parameters
        ----------
        found : RegisteredComplex
            The crowd, under its best placement.
        middles : ndarray, shape (B, 2), float64
            Of the blocks, metres.

        Returns
        -------
        Blocks
            Of all scans.
        """
        width = KERNEL_SHARE * found.reach_m
        near = cKDTree(found.xy).sparse_distance_matrix(
            cKDTree(middles), KERNEL_CUT * width, output_type="ndarray"
        )
        near = near[np.argsort(near["i"] * len(middles) + near["j"])]
        scan, block = near["i"], near["j"].astype(np.intp)
        apart = np.sqrt(np.square(middles[block] - found.xy[scan]).sum(axis=1))
        kernel, ring = exp(-0.5 * np.square(apart / width)), found.ring(apart)
        nothing = found.nats[:, 0]
        nearby = Nearby(
            np.searchsorted(scan, np.arange(found.size + 1)),
            block,
            kernel,
            (ring * found.nats.shape[1]).astype(np.int32),
            (found.nats - nothing[:, None]).ravel(),
        )
        return cls(
            nearby,
            nothing,
            np.asarray(NOBODY + np.bincount(block, kernel, len(middles)), np.float64),
            np.asarray(np.bincount(block, kernel * nothing[ring], len(middles)), np.float64),
        )

    def without(self, first: int, last: int) -> Self:
        """Return what is left without some scans in a row.

        Parameters
        ----------
        first, last : int
            The first one, and the one behind the last.

        Returns
        -------
        Blocks
            The scans keep their numbers.
        """
        near = self.nearby
        begin, end = near.start[[first, last]]
        block, kernel = near.block[begin:end], near.kernel[begin:end]
        levels = len(near.gain) // len(self.nothing)
        ring = near.row[begin:end] // levels
        left = near.kernel.copy()
        left[begin:end] = 0.0
        return self._replace(
            nearby=near._replace(kernel=left),
            total=self.total - np.bincount(block, kernel, len(self.total)),
            silent=self.silent - np.bincount(block, kernel * self.nothing[ring], len(self.silent)),
        )

    def nats(self, scan: IntArray, level: NDArray[np.int32], backend: Backend) -> FloatArray:
        """Return how well each block explains that some scans are alike.

        Parameters
        ----------
        scan : ndarray, shape (S,), int64
            Which scans.
        level : ndarray, shape (S,), int32
            How alike each is, as in `Sighting`.
        backend : Backend
            What adds up.

        Returns
        -------
        ndarray, shape (B,), float64
            Mean log-likelihood over the scans near the block.
        """
        told = backend.told(self.nearby, scan, level, len(self.silent))
        return np.asarray((self.silent + told) / self.total)
