"""Detection in k of n scans: what it must hold for any scans."""

import hypothesis.strategies as st
from hypothesis import given

from homsense.detection import MOST_SCANS, Detection

SCANS = st.lists(st.frozensets(st.sampled_from("abcdef")), min_size=1, max_size=8)
DETECTIONS = st.builds(
    lambda scans, short: Detection(max(1, scans - short), scans),
    st.integers(1, MOST_SCANS),
    st.integers(0, MOST_SCANS),
)


@given(SCANS)
def test_one_of_one_is_the_last_scan(latest: list[frozenset[str]]) -> None:
    assert Detection().in_view(latest) == latest[-1]


@given(SCANS, st.integers(1, MOST_SCANS))
def test_once_is_the_union_and_always_the_intersection(
    latest: list[frozenset[str]], scans: int
) -> None:
    window = latest[-scans:]
    assert Detection(1, scans).in_view(latest) == frozenset().union(*window)
    assert Detection(scans, scans).in_view(latest) == frozenset.intersection(*window)


@given(SCANS, DETECTIONS)
def test_asking_for_more_sees_less_and_order_is_of_no_account(
    latest: list[frozenset[str]], detection: Detection
) -> None:
    window = latest[-detection.scans :]
    seen = detection.in_view(latest)
    assert seen == detection.in_view(list(reversed(window)))
    if detection.times < detection.scans:
        assert detection._replace(times=detection.times + 1).in_view(latest) <= seen


@given(SCANS, DETECTIONS)
def test_scans_alike_are_seen_as_each_is(
    latest: list[frozenset[str]], detection: Detection
) -> None:
    assert detection.in_view([latest[0]] * len(latest)) == latest[0]
