"""Binary detection."""

import pytest

from homsense import InvalidScanError, LandmarkComplex, Reading, VisibilityRelation
from homsense import visible_landmarks as visible


def test_threshold_and_age_decide_what_is_visible() -> None:
    scan = [Reading("a", -60.0), Reading("b", -70.1), Reading("c", -50.0, 4.0), Reading("d")]
    assert visible(scan) == {"a", "b", "c", "d"}
    assert visible(scan, min_rssi_dbm=-70.0) == {"a", "c", "d"}
    assert visible(scan, min_rssi_dbm=-60.0, max_age_s=3.0) == {"a", "d"}


def test_a_landmark_heard_twice_is_visible_when_one_reading_is() -> None:
    scan = [Reading("a", -90.0), Reading("a", -50.0)]
    assert visible(scan, min_rssi_dbm=-60.0) == {"a"}


@pytest.mark.parametrize(
    ("landmark", "rssi", "age", "field"),
    [
        ("", -50.0, 0.0, "landmark"),
        ("a", float("nan"), 0.0, "rssi_dbm"),
        ("a", float("-inf"), 0.0, "rssi_dbm"),
        ("a", -50.0, -1.0, "age_s"),
        ("a", -50.0, float("nan"), "age_s"),
    ],
)
def test_a_malformed_reading_names_the_field(
    landmark: str, rssi: float, age: float, field: str
) -> None:
    with pytest.raises(InvalidScanError) as caught:
        Reading(landmark, rssi, age)
    assert caught.value.field == field


@pytest.mark.parametrize("observation", ["ab", [""], [3], [None]])
def test_an_observation_of_something_else_is_refused(observation: object) -> None:
    with pytest.raises(InvalidScanError):
        LandmarkComplex.from_observations([observation])  # type: ignore[list-item]


def test_a_relation_grows_by_new_values() -> None:
    one = VisibilityRelation.from_observations([{"a"}])
    two = one.with_observation({"a", "b"})
    assert len(one.rows) == 1
    assert two.transposed().rows == (frozenset({"0", "1"}), frozenset({"1"}))
