"""Laws of the landmark complex and its homology."""

import random
from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.oracles import (
    all_faces,
    gudhi_betti,
    gudhi_rank,
    hop_ball,
    maximal_sets,
    metric_ball,
)
from support.strategies import HOPS, OBSERVATION, OBSERVATIONS, SMALL_OBSERVATIONS

from homsense import (
    LandmarkComplex,
    VisibilityRelation,
    chains,
    landmark_complex,
    observation_complex,
    sense_local_homology,
    sense_within,
)
from homsense.cycles import round_holes
from homsense.skeleton import n_edges, skeleton

Observations = list[frozenset[str]]


def _balls(k: LandmarkComplex, visible: Iterable[str], radii: list[int]) -> list[frozenset[str]]:
    order, ends, _ = k.sense(visible, radii)
    return [k.names(order[:end]) for end in ends]


@given(SMALL_OBSERVATIONS, st.integers(1, 3))
def test_boundary_of_a_boundary_is_zero(observations: Observations, degree: int) -> None:
    twice = chains.boundary_matrix(observations, degree) @ chains.boundary_matrix(
        observations, degree + 1
    )
    assert abs(twice).sum() == 0


@given(SMALL_OBSERVATIONS)
def test_euler_characteristic_is_the_alternating_sum_of_betti_numbers(
    observations: Observations,
) -> None:
    k = LandmarkComplex.from_observations(observations)
    betti = k.betti_numbers(max_degree=4)
    assert k.euler_characteristic() == sum((-1) ** n * b for n, b in enumerate(betti))


@given(SMALL_OBSERVATIONS)
def test_euler_characteristic_is_the_alternating_sum_of_face_numbers(
    observations: Observations,
) -> None:
    k = LandmarkComplex.from_observations(observations)
    assert k.euler_characteristic() == sum(
        (-1) ** (len(face) - 1) for face in all_faces(observations)
    )


@given(OBSERVATIONS)
def test_landmark_and_observation_complex_have_equal_betti_numbers(
    observations: Observations,
) -> None:
    """Dowker's theorem."""
    relation = VisibilityRelation.from_observations(observations)
    ours, dual = landmark_complex(relation), observation_complex(relation)
    assert ours.betti_numbers() == dual.betti_numbers()
    assert ours.euler_characteristic() == dual.euler_characteristic()


@given(OBSERVATIONS)
def test_betti_numbers_are_those_of_gudhi(observations: Observations) -> None:
    k = LandmarkComplex.from_observations(observations)
    assert k.betti_numbers() == gudhi_betti(observations)


@pytest.mark.parametrize("seed", range(4))
def test_betti_numbers_are_those_of_gudhi_with_many_holes(seed: int) -> None:
    rng = random.Random(seed)
    for _ in range(60):
        names = [f"v{n}" for n in range(rng.randint(20, 90))]
        observations = [
            frozenset(rng.sample(names, rng.randint(0, 4))) for _ in range(rng.randint(0, 220))
        ]
        k = LandmarkComplex.from_observations(observations)
        assert k.betti_numbers() == gudhi_betti(observations)


@given(SMALL_OBSERVATIONS)
def test_real_and_gf2_betti_numbers_of_a_graph_agree(observations: Observations) -> None:
    """Graphs have no torsion, so the kernel of the Laplacian counts the same holes."""
    edges = [face for face in all_faces(observations) if len(face) <= 2]
    k = LandmarkComplex.from_observations(edges)
    assert chains.laplacian_kernel_dimension(k.facets, 0) == k.betti_numbers()[0]
    assert chains.laplacian_kernel_dimension(k.facets, 1) == k.betti_numbers()[1]


@given(OBSERVATIONS, st.randoms(use_true_random=False))
def test_order_and_duplication_of_scans_change_nothing(
    observations: Observations, rng: random.Random
) -> None:
    shuffled = [*observations, *rng.choices(observations or [frozenset()], k=5)]
    rng.shuffle(shuffled)
    one = LandmarkComplex.from_observations(observations)
    other = LandmarkComplex.from_observations(shuffled)
    assert one == other
    assert one.digest() == other.digest()
    assert hash(one) == hash(other)


@given(OBSERVATIONS, OBSERVATION, HOPS, st.randoms(use_true_random=False))
def test_order_and_duplication_of_scans_change_no_hop_history(
    observations: Observations, visible: frozenset[str], hops: list[int], rng: random.Random
) -> None:
    shuffled = [*observations, *rng.choices(observations or [frozenset()], k=5)]
    rng.shuffle(shuffled)
    one = LandmarkComplex.from_observations(observations).sense(visible, sorted(hops))
    other = LandmarkComplex.from_observations(shuffled).sense(visible, sorted(hops))
    assert one.homology == other.homology


@given(OBSERVATIONS, OBSERVATION)
def test_a_scan_inside_a_facet_changes_nothing(
    observations: Observations, kept: frozenset[str]
) -> None:
    k = LandmarkComplex.from_observations(observations)
    for facet in k.facets:
        assert k.with_observation(facet & kept) is k


@given(OBSERVATIONS)
def test_facets_are_the_maximal_observations(observations: Observations) -> None:
    assert LandmarkComplex.from_observations(observations).facets == maximal_sets(observations)


@given(OBSERVATIONS, OBSERVATIONS)
def test_union_is_the_complex_of_all_observations(one: Observations, other: Observations) -> None:
    union = LandmarkComplex.from_observations(one) | LandmarkComplex.from_observations(other)
    assert union == LandmarkComplex.from_observations([*one, *other])


@given(OBSERVATIONS, OBSERVATION)
def test_an_older_version_stays_valid(observations: Observations, more: frozenset[str]) -> None:
    k = LandmarkComplex.from_observations(observations)
    before = k.digest(), k.betti_numbers()
    k.with_observation(more)
    assert (k.digest(), k.betti_numbers()) == before


@given(OBSERVATIONS, OBSERVATION)
def test_the_induced_subcomplex_holds_the_faces_inside_the_set(
    observations: Observations, kept: frozenset[str]
) -> None:
    induced = LandmarkComplex.from_observations(observations).induced(kept)
    assert all_faces(induced.facets) == {face for face in all_faces(observations) if face <= kept}


@given(OBSERVATIONS, OBSERVATION, HOPS)
def test_hop_balls_follow_shortest_paths(
    observations: Observations, visible: frozenset[str], hops: list[int]
) -> None:
    k = LandmarkComplex.from_observations(observations)
    for radius, ball in zip(sorted(hops), _balls(k, visible, sorted(hops)), strict=True):
        assert ball == hop_ball(observations, set(visible), radius)


@given(OBSERVATIONS, OBSERVATION, HOPS)
def test_local_homology_is_that_of_the_induced_subcomplex(
    observations: Observations, visible: frozenset[str], hops: list[int]
) -> None:
    k = LandmarkComplex.from_observations(observations)
    for level in sense_local_homology(k, visible, hops):
        assert level.betti == gudhi_betti(k.induced(level.landmarks).facets)
        assert level.n_facets == len(maximal_sets(f & level.landmarks for f in k.facets))


@given(OBSERVATIONS, OBSERVATION, OBSERVATION, HOPS)
def test_what_is_left_out_is_not_in_the_complex(
    observations: Observations, visible: frozenset[str], gone: frozenset[str], hops: list[int]
) -> None:
    k = LandmarkComplex.from_observations(observations)
    rest = k.induced(k.landmarks - gone)
    metres = [80.0 * radius for radius in hops]
    for level, other in zip(
        [
            *sense_local_homology(k, visible, hops, without=gone),
            *sense_within(k, visible, metres, 80.0, without=gone),
        ],
        [*sense_local_homology(rest, visible, hops), *sense_within(rest, visible, metres, 80.0)],
        strict=True,
    ):
        assert level.landmarks == other.landmarks
        assert level.betti == other.betti


@given(OBSERVATIONS, OBSERVATION, HOPS)
def test_equal_ranges_make_metres_of_hops(
    observations: Observations, visible: frozenset[str], hops: list[int]
) -> None:
    k = LandmarkComplex.from_observations(observations)
    within = sense_within(k, visible, [64.0 * radius + 63.0 for radius in hops], 64.0)
    for level, other in zip(within, sense_local_homology(k, visible, hops), strict=True):
        assert level.landmarks == other.landmarks
        assert level.betti == other.betti


@given(OBSERVATIONS, OBSERVATION, st.lists(st.integers(0, 60), min_size=1, max_size=3))
def test_neighborhoods_in_metres_follow_shortest_paths(
    observations: Observations, visible: frozenset[str], radii: list[int]
) -> None:
    k = LandmarkComplex.from_observations(observations)
    ranges = {landmark: 2.0 ** (int(landmark[1:]) % 5) for landmark in k.landmarks}
    for level in sense_within(k, visible, map(float, radii), ranges):
        assert level.r_pseudo_m is not None
        assert level.landmarks == metric_ball(observations, set(visible), level.r_pseudo_m, ranges)
        assert level.betti == k.induced(level.landmarks).betti_numbers()


@given(OBSERVATIONS)
def test_cycles_stand_for_all_holes(observations: Observations) -> None:
    """Filling each cycle with a cone kills one class, and all cycles together kill all."""
    k = LandmarkComplex.from_observations(observations)
    betti = k.betti_numbers()
    cycles = round_holes(k.facets)
    assert len(cycles) == betti[1]
    for number, cycle in enumerate(cycles):
        for edge in zip(cycle, (*cycle[1:], cycle[0]), strict=True):
            assert set(edge) in k
            k = k.with_observation({*edge, f"apex {number}"})
        assert k.betti_numbers() == (betti[0], betti[1] - number - 1)


@given(OBSERVATIONS, OBSERVATION, st.integers(0, 3))
def test_lasting_holes_are_the_rank_of_the_inclusion(
    observations: Observations, visible: frozenset[str], radius: int
) -> None:
    k = LandmarkComplex.from_observations(observations)
    (level,) = sense_local_homology(k, visible, [radius], lasting=True)
    near, far = _balls(k, visible, [radius, radius + 1])
    assert level.lasting == gudhi_rank(k.induced(near).facets, k.induced(far).facets)


@given(OBSERVATIONS, HOPS)
def test_the_barcode_of_hops_is_that_of_gudhi(observations: Observations, hops: list[int]) -> None:
    k = LandmarkComplex.from_observations(observations)
    start = sorted(k.landmarks)[:1]
    balls, stages = _balls(k, start, sorted(hops)), k.sense(start, sorted(hops)).homology
    for here, near in enumerate(balls):
        for farther in range(here, len(balls)):
            assert stages.rank(here, farther) == gudhi_rank(
                k.induced(near).facets, k.induced(balls[farther]).facets
            )


@given(OBSERVATIONS)
def test_relabelling_changes_no_count(observations: Observations) -> None:
    renamed = [frozenset(f"x{landmark[::-1]}" for landmark in seen) for seen in observations]
    one = LandmarkComplex.from_observations(observations)
    other = LandmarkComplex.from_observations(renamed)
    assert one.betti_numbers() == other.betti_numbers()
    assert one.euler_characteristic() == other.euler_characteristic()
    assert n_edges(one) == n_edges(other)


@given(OBSERVATIONS)
def test_the_skeleton_holds_vertices_and_edges(observations: Observations) -> None:
    k = LandmarkComplex.from_observations(observations)
    graph = skeleton(k)
    assert set(graph) == k.landmarks
    assert {frozenset(edge) for edge in graph.edges} == {
        face for face in all_faces(observations) if len(face) == 2
    }
    assert graph.number_of_edges() == n_edges(k)
