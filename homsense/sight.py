"""Lines of sight on a map: which transmitters a place would see (assumption A4 of the paper)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from homsense.free_space import FreeSpace
from homsense.stages import blocked

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


class Sightings(NamedTuple):
    """Pairs of a place and a transmitter that see each other, by rising place.

    Parameters
    ----------
    place, transmitter : ndarray, shape (N,), intp
        Row numbers.
    distance_m : ndarray, shape (N,), float64
        Between the two.
    """

    place: IntArray
    transmitter: IntArray
    distance_m: FloatArray

    def kept(self, which: NDArray[np.bool_]) -> "Sightings":
        """Return some of the pairs.

        Parameters
        ----------
        which : ndarray, shape (N,), bool
            The pairs to keep.

        Returns
        -------
        Sightings
            In the same order.
        """
        return Sightings(self.place[which], self.transmitter[which], self.distance_m[which])

    def by_place(self, n_places: int) -> list[IntArray]:
        """Return what each place sees.

        Parameters
        ----------
        n_places : int
            How many places there are.

        Returns
        -------
        list of ndarray, intp
            Row numbers of transmitters.
        """
        return np.split(self.transmitter, np.searchsorted(self.place, np.arange(1, n_places)))


def in_view(
    free_space: FreeSpace, transmitters: FloatArray, places: FloatArray, range_m: float
) -> Sightings:
    """Return who sees whom within a range through free space.

    Parameters
    ----------
    free_space : FreeSpace
        What does not stop a line of sight.
    transmitters : ndarray, shape (T, 2), float64
        In free space, metres.
    places : ndarray, shape (P, 2), float64
        In free space, metres.
    range_m : float
        Longest line, metres.

    Returns
    -------
    Sightings
        A line that only cuts the corner of a cell may be free.
    """
    tree = KDTree(transmitters)
    near = KDTree(places).sparse_distance_matrix(tree, range_m, output_type="ndarray")
    near = near[np.lexsort((near["j"], near["i"]))]
    place, transmitter = near["i"], near["j"]
    here, there = places[place].T, transmitters[transmitter].T
    x, y, to_x, to_y = (column.astype(np.float32) for column in (*here, *there))
    clear = ~blocked(x, y, to_x, to_y, free_space.walls)
    return Sightings(place, transmitter, near["v"]).kept(clear)
