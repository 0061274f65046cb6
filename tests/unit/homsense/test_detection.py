"""A site chooses its detection by what foretells the next scan."""

import math
import random
from itertools import combinations

import pytest

from homsense import InvalidConfigurationError, LandmarkComplex, Profiles
from homsense.detection import (
    Detection,
    DetectionPoint,
    choose_detection,
    detection_curve,
)

AROUND, IN_VIEW, STRAY = 60, 9, 4
STREET = [f"{number:02}" for number in range(AROUND)]


def _truth(place: int) -> set[str]:
    return {STREET[(place + step) % AROUND] for step in range(IN_VIEW)}


def _profiles() -> Profiles:
    """Return those of a ring with more holes on one side, though neighbors differ."""
    scans = [{STREET[at], STREET[at - 1]} for at in range(AROUND)]
    for at, name in enumerate(STREET):
        for hole in range(round(4 + 4 * math.cos(2 * math.pi * at / AROUND)) + 7 * at % 9):
            corners = name, f"{name} {hole} a", f"{name} {hole} b"
            scans += [set(pair) for pair in combinations(corners, 2)]
    return Profiles(LandmarkComplex.from_observations(scans), (1, 2))


def _walks(missed: float, stray: float, pace: int) -> list[list[set[str]]]:
    chance = random.Random(1)
    return [
        [
            {name for name in sorted(_truth(start + step * pace)) if chance.random() >= missed}
            | {chance.choice(STREET) for _ in range(STRAY) if chance.random() < stray}
            for step in range(60)
        ]
        for start in range(0, AROUND, 12)
    ]


@pytest.mark.parametrize(
    ("missed", "stray", "pace", "wanted"),
    [(0.0, 0.0, 2, (1, 1)), (0.7, 0.0, 0, (1, 3)), (0.05, 0.8, 0, (3, 5))],
    ids=["all is heard", "much is missed", "much is not there"],
)
def test_a_site_chooses_what_its_scans_need(
    missed: float, stray: float, pace: int, wanted: tuple[int, int]
) -> None:
    chosen = choose_detection(detection_curve(_walks(missed, stray, pace), _profiles()))
    assert chosen is not None
    assert chosen.detection == wanted


def test_too_few_scans_or_equal_ones_choose_nothing() -> None:
    walks = _walks(0.0, 0.0, 1)
    assert detection_curve([walks[0][:20]], _profiles()) == []
    assert detection_curve([[_truth(3)] * 60], _profiles()) == []
    assert choose_detection([]) is None


def test_another_detection_must_be_clearly_better() -> None:
    alone = DetectionPoint(Detection(), 0.20)
    assert choose_detection([alone, DetectionPoint(Detection(1, 2), 0.16)]) == alone


@pytest.mark.parametrize("wrong", [(0, 1), (2, 1), (1, 6)])
def test_an_impossible_detection_is_refused(wrong: tuple[int, int]) -> None:
    with pytest.raises(InvalidConfigurationError) as refused:
        Detection(*wrong).checked()
    assert refused.value.field == "detection"
