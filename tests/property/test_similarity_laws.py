"""Laws of the similarity of scans."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy import ndimage

from homsense import Hearing, Reading
from homsense.registered.ground import nearness_m
from homsense.registered.similarity import ScanIndex

DBM = st.integers(-80, -40)
SCAN = st.dictionaries(st.sampled_from("abcdefgh"), DBM, min_size=3)


def readings(scan: dict[str, int]) -> list[Reading]:
    return [Reading(landmark, float(dbm)) for landmark, dbm in scan.items()]


def similarity(hearing: Hearing, one: dict[str, int], other: dict[str, int]) -> float:
    index = ScanIndex.of([hearing.signature(readings(other))])
    return float(index.similarities(hearing.signature(readings(one)))[0])


@given(SCAN, SCAN, st.sampled_from([0.0, 1.0, 1.5]))
def test_it_is_symmetric_and_one_for_equal_scans_only(
    one: dict[str, int], other: dict[str, int], exponent: float
) -> None:
    hearing = Hearing(exponent=exponent)
    found = similarity(hearing, one, other)
    assert 0.0 <= found <= 1.0
    assert np.isclose(found, similarity(hearing, other, one))
    assert np.isclose(similarity(hearing, one, one), 1.0)
    if exponent and one != other:
        assert found < 1.0


@given(SCAN, SCAN)
def test_it_is_jaccards_index_integrated_over_all_cuts(
    one: dict[str, int], other: dict[str, int]
) -> None:
    def heard(scan: dict[str, int], cut: int) -> set[str]:
        return {landmark for landmark, dbm in scan.items() if dbm >= cut}

    cuts = range(-80, -39)
    shared = sum(len(heard(one, cut) & heard(other, cut)) for cut in cuts)
    either = sum(len(heard(one, cut) | heard(other, cut)) for cut in cuts)
    assert np.isclose(similarity(Hearing(exponent=1.0), one, other), shared / either)


@given(SCAN, SCAN)
def test_the_binary_sensor_is_jaccards_index(one: dict[str, int], other: dict[str, int]) -> None:
    found = similarity(Hearing(exponent=0.0), one, other)
    assert np.isclose(found, len(one.keys() & other.keys()) / len(one.keys() | other.keys()))


@given(st.lists(SCAN, min_size=1, max_size=8), SCAN)
def test_many_scans_are_compared_like_one(
    scans: list[dict[str, int]], one: dict[str, int]
) -> None:
    hearing = Hearing()
    index = ScanIndex.of([hearing.signature(readings(scan)) for scan in scans])
    together = index.similarities(hearing.signature(readings(one)))
    assert np.allclose(together, [similarity(hearing, one, scan) for scan in scans])


@given(
    array_shapes(min_dims=2, max_dims=2, max_side=30).flatmap(
        lambda shape: arrays(np.bool_, shape, fill=st.just(False))
    ),
    st.sampled_from([0.3, 1.0, 3.2, 20.0]),
    st.sampled_from([6.0, 10.0]),
)
def test_nearness_is_what_the_exact_distance_leaves_of_the_cap(
    cells: np.ndarray, cell_m: float, cap_m: float
) -> None:
    away = ndimage.distance_transform_edt(~cells) if cells.any() else np.inf
    exact = np.maximum(cap_m - cell_m * away, 0.0)
    assert np.array_equal(nearness_m(cells, cell_m, cap_m), np.broadcast_to(exact, cells.shape))
