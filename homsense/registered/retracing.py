"""Scans that heard too little to be placed, carried along by the motion of their walk."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from homsense.registered.complex import RegisteredComplex
from homsense.registered.crowd import WalkScan, legs, not_standing

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_FEWEST = 2
_STRETCH = 3


class Retraced(NamedTuple):
    """Where the scans of a crowd were made, those that heard nothing among them.

    Parameters
    ----------
    source : ndarray, shape (N,), int64
        Which of the scans that were given, walk by walk in the order of their names, each in order
        of time.
    xy : ndarray, shape (N, 2), float64
        Where each was made, metres.
    """

    source: IntArray
    xy: FloatArray

    def stretches(self, most: int) -> IntArray:
        """Choose some of the scans, most of them three in a row.

        Parameters
        ----------
        most : int
            How many there may be.

        Returns
        -------
        ndarray, shape (M,), int64
            Which of the N, rising; all of them when there are no more.

        Examples
        --------
        >>> Retraced(np.arange(14), np.zeros((14, 2))).stretches(7).tolist()
        [0, 1, 2, 6, 7, 8, 12]
        """
        every = max(1, -(-len(self.source) // most))
        chosen = np.flatnonzero(np.arange(len(self.source)) // _STRETCH % every == 0)
        return chosen[:most]


def retrace(found: RegisteredComplex, scans: Sequence[WalkScan]) -> Retraced:
    """Place all scans of the walks of a crowd, whatever they have heard.

    Parameters
    ----------
    found : RegisteredComplex
        The scans that have a place.
    scans : sequence of WalkScan
        What the complex was made of.

    Returns
    -------
    Retraced
        Those scans where they are, and the others of their walks between them: moved as the device
        has measured, turned as its walk is, and less the drift, which changes linearly over time.
        Left out are walks with fewer than two scans that have a place, what a phone that stands
        still repeats, and what lies beyond all scans that have a place, by more than their reach.
    """
    order = sorted(range(len(scans)), key=lambda number: (scans[number].walk, scans[number].t_s))
    made = [scans[number] for number in order]
    source, leg = np.array(order, np.int64), legs(made)
    xy = np.full((len(scans), 2), np.nan)
    xy[found.source] = found.xy
    for walk in np.split(source, np.flatnonzero(np.diff(leg)) + 1):
        xy[walk] = _retraced(xy[walk], [scans[number] for number in walk.tolist()])
    is_new = np.isin(source, found.source)
    is_new[not_standing(made, leg)] = True
    low, high = found.xy.min(axis=0) - found.reach_m, found.xy.max(axis=0) + found.reach_m
    source = source[is_new & ((xy >= low) & (xy <= high)).all(axis=1)[source]]
    return Retraced(source, xy[source])


def turned(own_xy: FloatArray, xy: FloatArray) -> float:
    """Return the rotation that fits places in the frame of a walk to those on the map best.

    Parameters
    ----------
    own_xy, xy : ndarray, shape (N, 2), float64
        The same places in both frames, metres.

    Returns
    -------
    float
        Radians, anticlockwise.

    Examples
    --------
    >>> turned(np.array([[0.0, 0.0], [2.0, 0.0]]), np.array([[5.0, 5.0], [5.0, 7.0]]))
    1.5707963267948966
    """
    own, there = own_xy - own_xy.mean(axis=0), xy - xy.mean(axis=0)
    across = (own[:, 0] * there[:, 1] - own[:, 1] * there[:, 0]).sum()
    return math.atan2(across, (own * there).sum())


def _retraced(xy: FloatArray, walk: Sequence[WalkScan]) -> FloatArray:
    """Return the places of a walk whose unknown ones are not numbers."""
    known = np.isfinite(xy[:, 0])
    if known.sum() < _FEWEST:
        return np.full_like(xy, np.nan)
    own_xy = np.array([(scan.x_m, scan.y_m) for scan in walk])
    t_s = np.array([scan.t_s for scan in walk])
    turn = turned(own_xy[known], xy[known])
    cos, sin = math.cos(turn), math.sin(turn)
    moved = own_xy @ np.array([[cos, sin], [-sin, cos]])
    drift = [np.interp(t_s, t_s[known], axis) for axis in (xy - moved)[known].T]
    return np.where(known[:, None], xy, moved + np.stack(drift, axis=1))
