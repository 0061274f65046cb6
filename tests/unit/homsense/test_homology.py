"""Golden complexes and scans that no face list could hold."""

import pytest
from support.builders import GOLDEN, named

from homsense import (
    ComputationLimitError,
    InvalidComplexError,
    LandmarkComplex,
    chains,
    sense_within,
)
from homsense import sense_local_homology as sense


@pytest.mark.parametrize("name", GOLDEN)
def test_golden_complexes_have_their_known_betti_numbers(name: str) -> None:
    simplices, betti = GOLDEN[name]
    k = LandmarkComplex.from_observations(named(simplices))
    assert k.betti_numbers() == betti[:2]
    assert k.betti_numbers(max_degree=2) == betti
    assert k.euler_characteristic() == betti[0] - betti[1] + betti[2]


def test_the_laplacian_of_the_projective_plane_has_no_hole_over_the_reals() -> None:
    simplices, _ = GOLDEN["6-vertex projective plane"]
    assert [chains.laplacian_kernel_dimension(named(simplices), k) for k in (0, 1, 2)] == [1, 0, 0]


def test_a_scan_of_400_landmarks_lists_no_face() -> None:
    names = [f"l{n}" for n in range(1200)]
    scans = [names[start : start + 400] for start in range(0, 1200, 200)]
    scans[-1] = names[1000:] + names[:200]
    k = LandmarkComplex.from_observations(scans)
    assert k.betti_numbers() == (1, 1)
    assert k.euler_characteristic() == 0
    near, far = sense(k, names[:400], hops=[0, 3])
    assert (near.holes, near.n_landmarks) == (0, 400)
    assert (far.holes, far.n_landmarks, far.n_facets, far.euler) == (1, 1200, 6, 0)


def test_listing_faces_beyond_the_limit_is_refused() -> None:
    k = LandmarkComplex.from_observations([[f"l{n}" for n in range(400)]])
    with pytest.raises(ComputationLimitError, match="limit"):
        k.betti_numbers(max_degree=2)


def test_euler_characteristic_beyond_the_effort_is_refused() -> None:
    simplices, _ = GOLDEN["7-vertex torus"]
    k = LandmarkComplex.from_observations(named(simplices))
    with pytest.raises(ComputationLimitError, match="terms"):
        k.euler_characteristic(max_terms=3)


def test_the_empty_complex_has_nothing() -> None:
    k = LandmarkComplex.from_observations([])
    assert k.betti_numbers() == (0, 0)
    assert k.euler_characteristic() == 0
    assert k.facets == frozenset()
    (level,) = sense(k, {"a"}, hops=[2])
    assert (level.betti, level.holes, level.n_landmarks, level.n_facets, level.euler) == (
        (0, 0), 0, 0, 0, 0,
    )  # fmt: skip


def test_unknown_landmarks_are_ignored() -> None:
    k = LandmarkComplex.from_observations([{"a", "b"}])
    (level,) = sense(k, {"a", "stranger"}, hops=[0])
    assert level.landmarks == {"a"}


def test_hops_come_back_in_the_order_asked() -> None:
    k = LandmarkComplex.from_observations([{"a", "b"}, {"b", "c"}, {"c", "d"}])
    levels = sense(k, {"a"}, hops=[3, 0, 3])
    assert [(level.hops, level.n_landmarks) for level in levels] == [(3, 4), (0, 1), (3, 4)]


def test_negative_hops_and_degrees_are_refused() -> None:
    k = LandmarkComplex.from_observations([{"a", "b"}])
    with pytest.raises(InvalidComplexError, match="hops"):
        sense(k, {"a"}, hops=[-1])
    with pytest.raises(InvalidComplexError, match="metres"):
        sense_within(k, {"a"}, [float("nan")], 80.0)
    with pytest.raises(InvalidComplexError, match="s_max_m"):
        sense_within(k, {"a"}, [100.0], {"a": 80.0})
    with pytest.raises(InvalidComplexError, match="max_degree"):
        k.betti_numbers(max_degree=-1)
    with pytest.raises(InvalidComplexError, match="degree"):
        chains.laplacian(k.facets, -1)


def test_membership_and_union_with_something_else() -> None:
    k = LandmarkComplex.from_observations([{"a", "b", "c"}])
    assert {"a", "b"} in k
    assert {"a", "x"} not in k
    assert set() not in k
    assert k != "k"
    assert repr(k) == "<LandmarkComplex: 3 landmarks, 1 facets>"
    with pytest.raises(TypeError):
        k | 3  # type: ignore[operator]
