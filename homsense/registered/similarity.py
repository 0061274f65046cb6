"""How much two scans hear alike: Jaccard's index, integrated over the RSSI filtration.

A landmark heard at strength ``s`` is in view at every cut below it, so a scan is a nested family
of observations. The similarity of two scans is the measure of what they share over all cuts to the
measure of what either hears: ``sum(min(a, b)) / sum(max(a, b))``. With one cut only it is the
Jaccard index of two observations, the binary sensor of the paper.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from homsense.errors import InvalidConfigurationError
from homsense.ragged import spread
from homsense.scan import Reading

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Signature = Mapping[str, float]

MIN_HEARD = 3


@dataclass(frozen=True, slots=True)
class Hearing:
    """What of a scan counts, and how much.

    Parameters
    ----------
    weakest_dbm : float, default -80.0
        Weakest strength that counts, dBm.
    exponent : float, default 1.5
        A strength counts as its height above the weakest to this power; 0 makes the sensor
        binary. Not negative.
    max_age_s : float, default 3.0
        Oldest sighting that counts, seconds.

    Raises
    ------
    InvalidConfigurationError
        If the exponent is negative.
    """

    weakest_dbm: float = -80.0
    exponent: float = 1.5
    max_age_s: float = 3.0

    def __post_init__(self) -> None:
        if not self.exponent >= 0.0:
            message = f"exponent must not be negative, not {self.exponent}"
            raise InvalidConfigurationError(message, "exponent")

    def signature(self, readings: Iterable[Reading]) -> dict[str, float]:
        """Return what a scan hears, with the measure of the cuts that let it pass.

        Parameters
        ----------
        readings : iterable of Reading
            A scan; a reading without strength counts as one.

        Returns
        -------
        dict of str to float
            By landmark; empty when fewer than three landmarks are heard.

        Examples
        --------
        >>> heard = [Reading("a", -80.0), Reading("b", -77.0), Reading("c", -81.0), Reading("d")]
        >>> Hearing(exponent=1.0).signature(heard)
        {'a': 1.0, 'b': 4.0, 'd': 1.0}
        """
        found: dict[str, float] = {}
        for reading in readings:
            if reading.age_s > self.max_age_s:
                continue
            height = 1.0
            if reading.rssi_dbm is not None:
                height = reading.rssi_dbm - self.weakest_dbm + 1.0
            if height >= 1.0:
                found[reading.landmark] = max(
                    height**self.exponent, found.get(reading.landmark, 0.0)
                )
        return found if len(found) >= MIN_HEARD else {}

    def heights_db(self, amounts: FloatArray) -> FloatArray:
        """Return how far above what just counts some landmarks were heard.

        Parameters
        ----------
        amounts : ndarray, float64
            Of a signature.

        Returns
        -------
        ndarray, float64
            Whole dB, 1 for what just counts; 1 for all when the sensor is binary.

        Examples
        --------
        >>> heard = Hearing().signature([Reading(name, -61.0) for name in "abc"])
        >>> Hearing().heights_db(np.array([*heard.values()])).tolist()
        [20.0, 20.0, 20.0]
        """
        if not self.exponent:
            return np.ones(len(amounts))
        return np.asarray(np.rint(amounts ** (1.0 / self.exponent)))


@dataclass(frozen=True)
class ScanIndex:
    """Signatures by landmark, so that one scan is compared with all in one pass.

    Parameters
    ----------
    column : dict of str to int
        Number of each landmark.
    start : ndarray, shape (n_landmarks + 1,), int64
        Where the postings of each landmark begin.
    scan : ndarray, int64
        Which scan, for each posting.
    amount : ndarray, float64
        How much of the landmark it hears.
    total : ndarray, shape (n_scans,), float64
        Sum of the amounts of each scan.
    """

    column: dict[str, int]
    start: IntArray
    scan: IntArray
    amount: FloatArray
    total: FloatArray

    @classmethod
    def of(cls, signatures: Sequence[Signature]) -> Self:
        """Return the index of some scans.

        Parameters
        ----------
        signatures : sequence of mapping of str to float
            From `Hearing.signature`.

        Returns
        -------
        ScanIndex
            Scans are numbered in order.
        """
        column: dict[str, int] = {}
        for signature in signatures:
            for landmark in signature:
                column.setdefault(landmark, len(column))
        which = [column[landmark] for signature in signatures for landmark in signature]
        column_of = np.array(which, np.int64)
        amount = np.array([part for signature in signatures for part in signature.values()])
        scan = np.repeat(np.arange(len(signatures)), [len(heard) for heard in signatures])
        order = np.argsort(column_of, kind="stable")
        start = np.concatenate([[0], np.cumsum(np.bincount(column_of, minlength=len(column)))])
        total = np.bincount(scan, amount, len(signatures)).astype(np.float64)
        return cls(column, start, scan[order], amount[order].astype(np.float64), total)

    def similarities(self, signature: Signature) -> FloatArray:
        """Compare a scan with all.

        Parameters
        ----------
        signature : mapping of str to float
            The scan.

        Returns
        -------
        ndarray, shape (n_scans,), float64
            In [0, 1]; 1 for an equal scan.

        Examples
        --------
        >>> index = ScanIndex.of([{"a": 1.0, "b": 1.0}, {"b": 1.0, "c": 1.0}, {"d": 2.0}])
        >>> index.similarities({"a": 1.0, "b": 1.0}).round(3).tolist()
        [1.0, 0.333, 0.0]
        """
        known = [
            (self.column[name], part) for name, part in signature.items() if name in self.column
        ]
        if not known:
            return np.zeros(len(self.total))
        number = np.array([column for column, _ in known])
        part = np.array([amount for _, amount in known])
        size = self.start[number + 1] - self.start[number]
        _, posting = spread(self.start[number], size)
        shared = np.bincount(
            self.scan[posting],
            np.minimum(self.amount[posting], np.repeat(part, size)),
            len(self.total),
        )
        either = self.total + sum(signature.values()) - shared
        return np.divide(shared, either, out=np.zeros_like(shared), where=either > 0.0)
