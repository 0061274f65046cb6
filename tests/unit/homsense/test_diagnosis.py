"""A site is judged by what it has learnt, and told what could be set."""

from dataclasses import replace
from functools import cache

import pytest
from support.builders import feature, local_map, square

from homsense import (
    Detection,
    DetectionPoint,
    Expectation,
    FreeSpace,
    RadioModel,
    RangePoint,
    SiteMap,
    diagnose,
    expect,
)

TOWN = SiteMap.from_geojson(
    local_map(
        *(feature(square(70 * i, 70 * j, 45)) for i in range(3) for j in range(3)),
        feature(square(-20, -20, 230), role="domain"),
    )
)
RADIO = RadioModel(transmitters=60, range_m=50.0, evenness=10, scans=200)
CURVE = [
    RangePoint(-60.0, 3.0, 40, 60, (3, 2), 1, 0),
    RangePoint(-63.0, 6.0, 55, 80, (1, 9), -8, 8),
    RangePoint(-66.0, 9.0, 60, 90, (1, 4), 2, 3),
]


FORETOLD = [DetectionPoint(Detection(), 0.3), DetectionPoint(Detection(1, 3), 0.1)]


@cache
def _expected() -> Expectation:
    return expect(FreeSpace.of(TOWN, 3.0), RADIO, (1, 2, 3), worlds=4)


def _verdicts(**known: object) -> dict[str, tuple[str, str]]:
    given = {"in_view": 6.0, **known}
    found = diagnose(TOWN, given.pop("radio", RADIO), _expected(), **given)  # type: ignore[arg-type]
    return {finding.topic: (finding.verdict, finding.advice) for finding in found.findings}


def test_a_range_beyond_the_pitch_is_bad_and_a_cut_is_advised() -> None:
    assert _verdicts()["range"] == ("good", "")
    verdict, advice = _verdicts(radio=replace(RADIO, range_m=120.0))["range"]
    assert verdict == "bad"
    assert "min_rssi_dbm" in advice


@pytest.mark.parametrize(
    ("known", "topic", "advice"),
    [
        ({"in_view": 1.5}, "density", "more transmitters, or a weaker min_rssi_dbm"),
        ({"in_view": 200.0}, "density", "a stronger min_rssi_dbm"),
        ({"radio": replace(RADIO, dropout=0.45)}, "dropout", "longer scans"),
        ({"stale_share": 0.4}, "stale sightings", "max_age_s 3"),
        (
            {"gains": (0.9, 1.0, 2.6)},
            "likeness",
            "a line of sight does not decide what is heard here; do not trust counts",
        ),
        ({"foretold": FORETOLD}, "detection", "detection [1, 3]"),
        ({"median_witnesses": 325.0}, "witnesses", "quorum 4"),
        ({"curve": CURVE, "min_rssi_dbm": -66.0}, "chi alarm", "a stronger min_rssi_dbm"),
        ({"curve": CURVE, "min_rssi_dbm": -66.0}, "RSSI cut", "min_rssi_dbm -63"),
        (
            {"curve": CURVE, "min_rssi_dbm": -60.0},
            "fragmentation",
            "more scans between the parts, or a longer range",
        ),
    ],
    ids=str,
)
def test_what_hinders_is_named_with_what_to_set(
    known: dict[str, object], topic: str, advice: str
) -> None:
    assert _verdicts(**known)[topic] == ("doubtful", advice)


def test_a_site_in_order_has_nothing_to_set() -> None:
    found = _verdicts(
        curve=CURVE, min_rssi_dbm=-63.0, median_witnesses=20.0, foretold=FORETOLD[:1]
    )
    assert {verdict for topic, (verdict, _) in found.items() if topic != "information"} == {"good"}


def test_a_site_unlike_its_simulations_is_bad_whatever_it_promises() -> None:
    found = diagnose(TOWN, RADIO, _expected(), in_view=6.0, gains=(0.1, 0.2, 0.3))
    assert found.verdict == "bad"
    assert "cannot help" in found.summary


def test_the_verdict_follows_the_information() -> None:
    expected = _expected()
    bits = (3.0, 3.5, 4.0), (0.9, 0.9, 0.9), (0.1, 0.1, 0.1)
    verdicts = [
        diagnose(TOWN, RADIO, replace(expected, information_bits=told), in_view=6.0).verdict
        for told in bits
    ]
    assert verdicts == ["good", "doubtful", "bad"]
