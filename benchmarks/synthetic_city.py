"""A city of rectangular buildings and its scans by line of sight, fast enough for 10^6 scans."""

from itertools import pairwise
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

PITCH_M = 86.0
OFF_M = 0.05
Array = NDArray[Any]


class City(NamedTuple):
    """Square blocks of `PITCH_M`, most with one building, and transmitters.

    Parameters
    ----------
    buildings : ndarray, shape (blocks, blocks, 4), float64
        West, south, east, north in metres; an empty block has an empty one.
    transmitters : ndarray, shape (n, 2), float64
        Half of them anywhere outside, half on the faces of buildings.
    first : ndarray, int64
        The transmitters of block b are ``first[b]:first[b + 1]``.
    range_m : float
        Farther ones are not heard.
    """

    buildings: Array
    transmitters: Array
    first: Array
    range_m: float


class Scans(NamedTuple):
    """Transmitter numbers of each scan: ``heard[ends[i]:ends[i + 1]]``, rising."""

    ends: Array
    heard: Array

    def named(self) -> list[frozenset[str]]:
        """Return the scans as sets of identifiers."""
        names = [f"{n:06x}" for n in range(int(self.heard.max(initial=0)) + 1)]
        ends, heard = self.ends.tolist(), self.heard.tolist()
        return [frozenset([names[n] for n in heard[start:end]]) for start, end in pairwise(ends)]


def city(seed: int, n_transmitters: int, range_m: float, blocks: int = 7) -> City:
    """Return a city; 9 of 10 blocks have a building (44 of 49)."""
    rng = np.random.Generator(np.random.PCG64(seed))
    corner = PITCH_M * np.indices((blocks, blocks)).transpose(1, 2, 0)
    low = corner + rng.uniform(8.0, 22.0, (blocks, blocks, 2))
    high = corner + PITCH_M - rng.uniform(8.0, 22.0, (blocks, blocks, 2))
    buildings: Array = np.concatenate([low, high], axis=2).reshape(-1, 4)
    empty = rng.choice(len(buildings), round(len(buildings) * 5 / 49), replace=False)
    buildings[empty, 2:] = buildings[empty, :2]
    buildings = buildings.reshape(blocks, blocks, 4)
    free = _outside(rng, buildings, n_transmitters - n_transmitters // 2)
    places = np.concatenate([free, _on_faces(rng, buildings, n_transmitters // 2)])
    block = _block(places, blocks)
    order = np.argsort(block, kind="stable")
    first = np.searchsorted(block[order], np.arange(blocks * blocks + 1))
    return City(buildings, places[order], first, range_m)


def scans(town: City, seed: int, count: int, margin_m: float = 0.0) -> Scans:
    """Return what is heard at places outside the buildings, and not too near to the edge."""
    rng = np.random.Generator(np.random.PCG64([seed, 1]))
    places = np.empty((0, 2))
    while len(places) < count:
        tried = _outside(rng, town.buildings, count)
        inside = np.abs(tried - len(town.buildings) * PITCH_M / 2)
        reach = len(town.buildings) * PITCH_M / 2 - margin_m
        places = np.concatenate([places, tried[(inside <= reach).all(axis=1)]])
    return Scans(*_heard(town, places[:count]))


def _block(places: Array, blocks: int) -> Array:
    at = np.clip((places // PITCH_M).astype(np.int64), 0, blocks - 1)
    return at[:, 0] * blocks + at[:, 1]


def _outside(rng: np.random.Generator, buildings: Array, count: int) -> Array:
    blocks = len(buildings)
    kept = np.empty((0, 2))
    while len(kept) < count:
        tried = rng.uniform(0.0, blocks * PITCH_M, (2 * count + 16, 2))
        west, south, east, north = buildings.reshape(-1, 4)[_block(tried, blocks)].T
        x, y = tried.T
        inside = (west <= x) & (x <= east) & (south <= y) & (y <= north) & (east > west)
        kept = np.concatenate([kept, tried[~inside]])
    return kept[:count]


def _on_faces(rng: np.random.Generator, buildings: Array, count: int) -> Array:
    standing = buildings.reshape(-1, 4)
    standing = standing[standing[:, 2] > standing[:, 0]]
    west, south, east, north = standing[rng.integers(len(standing), size=count)].T
    along, side = rng.random(count), rng.integers(4, size=count)
    x, y = west + along * (east - west), south + along * (north - south)
    x = np.select([side == 0, side == 1], [west - OFF_M, east + OFF_M], x)
    y = np.select([side == 2, side == 3], [south - OFF_M, north + OFF_M], y)  # noqa: PLR2004
    return np.stack([x, y], axis=1)


@numba.njit(cache=True)
def _heard(town: City, places: Array) -> tuple[Array, Array]:
    blocks = len(town.buildings)
    reach = int(town.range_m // PITCH_M) + 1
    ends = np.zeros(len(places) + 1, np.int64)
    heard = np.empty(1024, np.int32)
    size = 0
    for scan in range(len(places)):
        x, y = places[scan]
        i, j = min(int(x // PITCH_M), blocks - 1), min(int(y // PITCH_M), blocks - 1)
        for column in range(max(0, i - reach), min(blocks, i + reach + 1)):
            south = max(0, j - reach)
            north = min(blocks - 1, j + reach)
            for n in range(
                town.first[column * blocks + south], town.first[column * blocks + north + 1]
            ):
                u, v = town.transmitters[n]
                if (u - x) ** 2 + (v - y) ** 2 <= town.range_m**2 and _clear(town, x, y, u, v):
                    if size == len(heard):
                        longer = np.empty(2 * size, np.int32)
                        longer[:size] = heard
                        heard = longer
                    heard[size] = n
                    size += 1
        ends[scan + 1] = size
    return ends, heard[:size].copy()


@numba.njit(cache=True)
def _clear(town: City, x: float, y: float, u: float, v: float) -> bool:
    """Tell whether a straight line meets no building."""
    blocks = len(town.buildings)
    for i in range(max(0, int(min(x, u) // PITCH_M)), min(blocks, int(max(x, u) // PITCH_M) + 1)):
        for j in range(
            max(0, int(min(y, v) // PITCH_M)), min(blocks, int(max(y, v) // PITCH_M) + 1)
        ):
            west, south, east, north = town.buildings[i, j]
            if east <= west:
                continue
            enter, leave = 0.0, 1.0
            for start, step, low, high in ((x, u - x, west, east), (y, v - y, south, north)):
                if step == 0.0:
                    if start <= low or start >= high:
                        leave = -1.0
                    continue
                near, far = (low - start) / step, (high - start) / step
                enter, leave = max(enter, min(near, far)), min(leave, max(near, far))
            if enter < leave:
                return False
    return True
