"""How bent a crowd lies tells a wrong place from the right one, without any truth."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from support.corridors import Building, mirrored

from homsense import Reading, WalkScan, register_crowd
from homsense.registered.crowd import Crowd, likeness
from homsense.registered.layout import Layout, Pull, settle
from homsense.registered.matching import Placement
from homsense.registered.registration import STRAINED, Registration

FloatArray = NDArray[np.float64]


def strain(pulled: Callable[[FloatArray], FloatArray]) -> float:
    """Return how bent two walks along a line are that something pulls elsewhere."""
    crowd = Crowd.of(
        WalkScan(
            str(number),
            5.0 * x,
            x,
            0.0,
            tuple(Reading(f"a{at}", -50.0) for at in range(0, 60, 5) if abs(at - x) < 12.0),
        )
        for number in range(2)
        for x in np.arange(0.0, 60.0, 2.0).tolist()
    )
    start = Layout(crowd.own_xy, np.zeros(2), np.zeros(2))
    *_, found = settle(crowd, likeness(crowd), start, lambda _: Pull(pulled(crowd.own_xy), 3.0))
    return float(found.strain.mean())


def test_a_crowd_is_hardly_bent_wherever_it_may_lie_as_it_walked() -> None:
    here, there = strain(lambda xy: xy), strain(lambda xy: xy + np.array([7.0, -3.0]))
    assert there == pytest.approx(here, rel=1e-3)
    assert here < STRAINED / 10.0


def test_a_crowd_is_bent_the_more_the_more_its_ground_differs_from_its_walks() -> None:
    bent = [
        strain(lambda xy, by_m=by_m: xy + by_m * np.sin(xy[:, ::-1] / 6.0))  # type: ignore[misc]
        for by_m in (1.0, 2.0, 4.0, 8.0)
    ]
    assert all(less < more for less, more in pairwise(bent))


def test_a_mirrored_map_bends_a_crowd_and_its_own_does_not() -> None:
    building = Building.of(0)
    ground = building.free_space
    crowd = building.crowd(10, 40)
    own, foreign = (
        register_crowd(crowd, space).registration for space in (ground, mirrored(ground))
    )
    assert own.strain < STRAINED < foreign.strain


@pytest.mark.parametrize("strain", [0.0, STRAINED - 0.01, STRAINED + 0.01])
def test_a_crowd_that_bends_too_much_is_doubtful(strain: float) -> None:
    only = Placement(0.0, 1.0, 0.0, 0.0, 2.0)
    assert Registration((only,), 5.0, strain).is_doubtful is (strain > STRAINED)
