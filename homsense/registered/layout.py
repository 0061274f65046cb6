"""A layout of the crowd without any position: robust sparse least squares over a pose graph.

Unknown are the place of each scan, and for each walk the bias of its heading and the scale of its
steps. Own motion says where the next scan of a walk is, likeness draws scans of different walks
together; edges that do not fit lose their weight round by round. Scans of different walks that lie
close and hear nothing alike are driven apart: without that a layout comes out far too small.
"""

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from homsense.registered.crowd import Crowd, Likeness, each_once

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

STEP_FLOOR_M, STEP_SHARE = 0.1, 0.1
STEP_SCALE, HEADING_RAD = 0.05, 0.1
REST_SHARE = 0.66
AROUND, UNLIKE_EACH = 60, 4
EDGES_DEPEND = 2.0
TOGETHER_ROUNDS, LAY_OUT_ROUNDS = 5, 14
STILL_M = 0.03
PART_SHARE = 0.2
_FIRST_TOLERANCE, _TIGHTER, _LAST_TOLERANCE = 12.0, 0.6, 2.5
_HARDLY = 1e-4


@dataclass(frozen=True)
class Layout:
    """Where each scan is, relative to the others.

    Parameters
    ----------
    xy : ndarray, shape (N, 2), float64
        Places, metres, in a frame of their own.
    heading : ndarray, shape (W,), float64
        What to add to the headings of each walk, radians.
    log_step : ndarray, shape (W,), float64
        Logarithm of what to multiply its steps by.
    strain : ndarray, shape (N,), float64
        What the equations of the last round leave of each scan, squares of deviations; empty
        before the first.
    """

    xy: FloatArray
    heading: FloatArray
    log_step: FloatArray
    strain: FloatArray = field(default_factory=lambda: np.empty(0))


class Pull(NamedTuple):
    """Where something outside the crowd wants the scans to be.

    Parameters
    ----------
    to : ndarray, shape (N, 2), float64
        Places, metres.
    sd_m : float
        How much they may differ, metres.
    """

    to: FloatArray
    sd_m: float


class _Edges(NamedTuple):
    """Pairs of scans, how far apart their places should be, and how sure that is."""

    first: IntArray
    second: IntArray
    rest: FloatArray
    weight: FloatArray

    def with_others(self, others: "_Edges") -> "_Edges":
        return _Edges(*(np.concatenate(both) for both in zip(self, others, strict=True)))


class _Rows(NamedTuple):
    """Weighted equations: row, column and value of each coefficient; owners, right-hand sides."""

    row: list[IntArray]
    column: list[IntArray]
    value: list[FloatArray]
    owner: list[IntArray]
    right: list[FloatArray]

    @property
    def size(self) -> int:
        return sum(map(len, self.right))

    def add(self, right: FloatArray, *terms: tuple[IntArray, FloatArray]) -> None:
        row = self.size + np.arange(len(right))
        for column, value in terms:
            self.row.append(row)
            self.column.append(column)
            self.value.append(value)
        self.owner.append(terms[0][0])
        self.right.append(right)

    def solved(self, unknowns: int) -> tuple[FloatArray, FloatArray]:
        """Return the unknowns, and sums of squares of what they leave, by the first unknown."""
        where = np.concatenate(self.row), np.concatenate(self.column)
        shape = self.size, unknowns
        equations = sparse.csc_array((np.concatenate(self.value), where), shape=shape)
        normal = (equations.T @ equations).tocsc()
        factors = splu(
            normal,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        right = np.concatenate(self.right)
        found: FloatArray = factors.solve(np.asarray(equations.T @ right))
        left = np.asarray(equations @ found) - right
        owner = np.concatenate(self.owner)
        return found, np.asarray(np.bincount(owner, np.square(left), unknowns), np.float64)


def lay_out(crowd: Crowd, like: Likeness) -> Layout:
    """Lay a crowd out.

    Parameters
    ----------
    crowd : Crowd
        Walks whose headings share a reference, such as east.
    like : Likeness
        Its edges.

    Returns
    -------
    Layout
        In parts that no edge joins.
    """
    heading = np.zeros(crowd.n_walks)
    state = Layout(np.zeros((crowd.size, 2)), heading, np.zeros(crowd.n_walks))
    for number in range(LAY_OUT_ROUNDS):
        if number < TOGETHER_ROUNDS:
            edges = _alike(state, like, np.zeros((len(like.first), 2)), number)
        else:
            edges = _spaced(state, crowd, like, number)
        state = _improved(crowd, state, edges, heading, None)
    return state


def settle(
    crowd: Crowd, like: Likeness, start: Layout, pull: Callable[[FloatArray], Pull]
) -> Iterator[Layout]:
    """Lay a crowd out again where it has been placed, round by round.

    Parameters
    ----------
    crowd : Crowd
        The walks.
    like : Likeness
        Its edges.
    start : Layout
        In the frame of the map.
    pull : callable
        Says for places where the ground wants them.

    Yields
    ------
    Layout
        In the frame of the map, after each round, until the scans stay where they are.
    """
    state = Layout(start.xy, start.heading, np.zeros(crowd.n_walks))
    for number in itertools.count():
        before, edges = state.xy, _spaced(state, crowd, like, number)
        state = _improved(crowd, state, edges, start.heading, pull(before))
        yield state
        if np.square(state.xy - before).sum(axis=1).mean() < STILL_M**2:
            return


def parts(crowd: Crowd, like: Likeness) -> IntArray:
    """Tell which scans hang together.

    Parameters
    ----------
    crowd : Crowd
        The walks.
    like : Likeness
        Its edges.

    Returns
    -------
    ndarray, shape (N,), int64
        Connected part of each scan, 0 for the largest; -1 for those of less than `PART_SHARE` of
        the scans, which fit into too many places.
    """
    steps = crowd.steps
    first, second = np.append(steps, like.first), np.append(steps + 1, like.second)
    joined = sparse.coo_array((np.ones(len(first)), (first, second)), (crowd.size, crowd.size))
    _, part = connected_components(joined, directed=False)
    sizes = np.bincount(part)
    rank = np.argsort(np.argsort(-sizes, kind="stable"))
    is_placed = (rank == 0) | (sizes >= PART_SHARE * crowd.size)
    return np.where(is_placed, rank, -1)[part]


def _spaced(state: Layout, crowd: Crowd, like: Likeness, number: int) -> _Edges:
    """Return what draws together, though not all the way, and what drives apart."""
    alike = _alike(state, like, _rest(state, like), number)
    return alike.with_others(_unlike(state, crowd, like))


def _rest(state: Layout, like: Likeness) -> FloatArray:
    """Return how far apart the ends of each edge may stay."""
    apart = state.xy[like.first] - state.xy[like.second]
    length = np.linalg.norm(apart, axis=1)
    kept = np.minimum(length, REST_SHARE * like.radio(like.similarity))
    rest: FloatArray = apart * (kept / np.maximum(length, 1e-9))[:, None]
    return rest


def _alike(state: Layout, like: Likeness, rest: FloatArray, number: int) -> _Edges:
    """Return what draws together; little where it does not fit (Geman and McClure)."""
    sd_m = EDGES_DEPEND * like.radio(like.similarity) / np.sqrt(2.0)
    miss = state.xy[like.first] - state.xy[like.second] - rest
    squares = (miss * miss).sum(axis=1) / (2.0 * sd_m**2)
    tolerance = max(_FIRST_TOLERANCE * _TIGHTER**number, _LAST_TOLERANCE)
    trust = 1.0 if number == 0 else tolerance / (tolerance + squares)
    return _Edges(like.first, like.second, rest, trust / sd_m)


def _unlike(state: Layout, crowd: Crowd, like: Likeness) -> _Edges:
    """Return what drives apart: for each scan the nearest of other walks that hear otherwise."""
    least_m = REST_SHARE * like.radio.reach_m
    size = min(AROUND, crowd.size)
    _, near = cKDTree(state.xy).query(state.xy, k=size, distance_upper_bound=least_m)
    one, other = np.repeat(np.arange(crowd.size), size), near.ravel()
    one, other = one[other < crowd.size], other[other < crowd.size]
    is_foreign = crowd.walk[one] != crowd.walk[other]
    one, other = one[is_foreign], other[is_foreign]
    pair = one * crowd.size + other
    at = np.minimum(np.searchsorted(like.compatible, pair), len(like.compatible) - 1)
    is_unlike = like.compatible[at] != pair
    one, other = one[is_unlike], other[is_unlike]
    is_near = np.arange(len(one)) - np.searchsorted(one, one) < UNLIKE_EACH
    low, high, _ = each_once(one[is_near], other[is_near], crowd.size)
    apart = state.xy[low] - state.xy[high]
    length = np.maximum(np.linalg.norm(apart, axis=1), _HARDLY)
    weight = np.full(len(low), np.sqrt(2.0) / (EDGES_DEPEND * least_m))
    return _Edges(low, high, apart * (least_m / length)[:, None], weight)


def _improved(
    crowd: Crowd,
    state: Layout,
    edges: _Edges,
    heading: FloatArray,
    pull: Pull | None,
) -> Layout:
    """Solve the equations, linear around a layout."""
    scans, walks = crowd.size, crowd.n_walks
    x, y = np.arange(scans), scans + np.arange(scans)
    bias, scale = 2 * scans + np.arange(walks), 2 * scans + walks + np.arange(walks)
    rows = _Rows([], [], [], [], [])

    here = crowd.steps
    own = crowd.own_xy[here + 1] - crowd.own_xy[here]
    owner = crowd.walk[here]
    sure = 1.0 / (STEP_FLOOR_M + STEP_SHARE * np.linalg.norm(own, axis=1))
    stretch = sure * np.exp(state.log_step[owner])
    cos, sin = stretch * np.cos(state.heading[owner]), stretch * np.sin(state.heading[owner])
    right, up = cos * own[:, 0] - sin * own[:, 1], sin * own[:, 0] + cos * own[:, 1]
    for place, along, across in ((x, right, -up), (y, up, right)):
        rows.add(
            along,
            (place[here + 1], sure),
            (place[here], -sure),
            (bias[owner], -across),
            (scale[owner], -along),
        )

    for axis, place in enumerate((x, y)):
        rows.add(
            edges.weight * edges.rest[:, axis],
            (place[edges.first], edges.weight),
            (place[edges.second], -edges.weight),
        )

    sure_of_heading = np.full(walks, 1.0 / HEADING_RAD)
    rows.add(sure_of_heading * (heading - state.heading), (bias, sure_of_heading))
    rows.add(-state.log_step / STEP_SCALE, (scale, np.full(walks, 1.0 / STEP_SCALE)))

    to, hold = np.zeros((scans, 2)), np.full(scans, _HARDLY)
    if pull is not None:
        to, hold = pull.to, np.full(scans, 1.0 / pull.sd_m)
    for axis, place in enumerate((x, y)):
        rows.add(hold * to[:, axis], (place, hold))

    found, left = rows.solved(2 * scans + 2 * walks)
    return Layout(
        np.stack([found[x], found[y]], axis=1),
        state.heading + found[bias],
        state.log_step + found[scale],
        left[x] + left[y],
    )
