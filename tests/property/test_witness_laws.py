"""Laws of the witness filtration: who saw it decides what counts."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.oracles import all_faces, faces_by_witnesses, gudhi_rank
from support.strategies import LANDMARKS

from homsense import (
    EpochFiltration,
    InvalidConfigurationError,
    WitnessFiltration,
    sense_local_homology,
    witness_curve,
)
from homsense.plain import from_plain, to_plain

WITNESS = st.sampled_from("abcd")
SCAN = st.frozensets(LANDMARKS, max_size=5)
CROWD = st.lists(st.tuples(WITNESS, SCAN), max_size=14)
Crowd = list[tuple[str, frozenset[str]]]


@given(CROWD, st.integers(1, 4))
def test_a_level_holds_what_enough_distinct_witnesses_saw(crowd: Crowd, depth: int) -> None:
    filtration = WitnessFiltration(depth).with_observations(crowd)
    for witnesses in range(1, depth + 1):
        known = faces_by_witnesses(crowd, witnesses)
        assert all_faces(filtration.level(witnesses).facets) == known


@given(CROWD, st.integers(1, 3), st.randoms(use_true_random=False))
def test_order_and_duplication_change_no_level(
    crowd: Crowd, depth: int, rng: random.Random
) -> None:
    shuffled = [*crowd, *rng.choices(crowd or [("a", frozenset())], k=4)]
    rng.shuffle(shuffled)
    built = WitnessFiltration(depth)
    for observed in shuffled:
        built = built.with_observations([observed])
    assert built.digest() == WitnessFiltration(depth).with_observations(crowd).digest()


@given(CROWD)
def test_lasting_holes_are_the_rank_between_neighbor_levels(crowd: Crowd) -> None:
    filtration = WitnessFiltration(3).with_observations(crowd)
    for point in witness_curve(crowd, depth=3):
        here, fewer = (filtration.level(max(1, point.witnesses - n)) for n in (0, 1))
        assert point.betti == here.betti_numbers()
        assert point.lasting == gudhi_rank(here.facets, fewer.facets)


@given(CROWD, CROWD, st.integers(1, 3))
def test_the_union_is_that_of_all_observations(one: Crowd, other: Crowd, depth: int) -> None:
    """Also when the same device is a witness in both."""
    empty = WitnessFiltration(depth)
    union = empty.with_observations(one) | empty.with_observations(other)
    assert union.digest() == empty.with_observations([*one, *other]).digest()


@given(CROWD, st.lists(SCAN, max_size=20), st.integers(2, 3))
def test_too_few_liars_can_only_confirm_what_somebody_honest_saw(
    crowd: Crowd, lies: list[frozenset[str]], quorum: int
) -> None:
    honest = WitnessFiltration(quorum).with_observations(crowd)
    liars = [(f"liar {n % (quorum - 1)}", scan) for n, scan in enumerate(lies)]
    poisoned = honest.with_observations(liars)
    faces = all_faces(poisoned.level(quorum).facets)
    assert all_faces(honest.level(quorum).facets) <= faces <= all_faces(honest.level(1).facets)


@given(st.lists(SCAN, max_size=12), st.lists(SCAN, max_size=20), st.integers(2, 3))
def test_too_few_liars_change_nothing_where_enough_honest_devices_have_been(
    places: list[frozenset[str]], lies: list[frozenset[str]], quorum: int
) -> None:
    crowd = [(f"honest {n}", place) for n in range(quorum) for place in places]
    liars = [(f"liar {n % (quorum - 1)}", scan) for n, scan in enumerate(lies)]
    honest = WitnessFiltration(quorum).with_observations(crowd)
    poisoned = honest.with_observations(liars)
    assert poisoned.level(quorum) == honest.level(quorum)


def test_ten_thousand_lies_of_one_device_change_no_robust_count_but_every_raw_one() -> None:
    rng = random.Random(1)
    names = [f"l{n:02d}" for n in range(60)]
    ring = [frozenset(names[(n + i) % 60] for i in range(5)) for n in range(60)]
    crowd = [(f"phone {n}", place) for n in range(2) for place in ring]
    honest = WitnessFiltration(2).with_observations(crowd)
    lies = [("liar", frozenset(rng.sample(names, rng.randint(2, 6)))) for _ in range(10_000)]
    poisoned = honest.with_observations(lies)
    changed = 0
    for landmark in names:
        robust, raw = (
            [level.holes for level in sense_local_homology(k, {landmark}, [2, 3, 20])]
            for k in (poisoned.level(2), poisoned.level(1))
        )
        before = sense_local_homology(honest.level(2), {landmark}, [2, 3, 20])
        assert robust == [level.holes for level in before] == [0, 0, 1]
        changed += raw != robust
    assert changed == len(names)


def test_levels_that_are_not_kept_are_refused() -> None:
    with pytest.raises(InvalidConfigurationError, match="depth"):
        WitnessFiltration(0)
    with pytest.raises(InvalidConfigurationError, match="witnesses"):
        WitnessFiltration(2).level(3)
    with pytest.raises(TypeError):
        WitnessFiltration(2) | WitnessFiltration(3)


EPOCHS = st.lists(st.tuples(st.integers(0, 4), WITNESS, SCAN), max_size=14)


@given(EPOCHS, EPOCHS, st.integers(1, 3), st.integers(0, 5))
def test_what_is_older_than_an_epoch_was_never_seen(
    before: list[tuple[int, str, frozenset[str]]],
    after: list[tuple[int, str, frozenset[str]]],
    depth: int,
    epoch: int,
) -> None:
    empty = WitnessFiltration(depth)
    kept = EpochFiltration(empty).with_observations(before).since(epoch)
    built = kept.with_observations(after)
    left = [*(entry for entry in before if entry[0] >= epoch), *after]
    assert built.epochs == sorted({entry[0] for entry in left})
    assert built.merged.digest() == empty.with_observations(e[1:] for e in left).digest()


@given(EPOCHS, EPOCHS, st.integers(1, 3))
def test_a_filtration_that_was_kept_as_plain_arrays_grows_as_it_would_have(
    before: list[tuple[int, str, frozenset[str]]],
    after: list[tuple[int, str, frozenset[str]]],
    depth: int,
) -> None:
    lived = EpochFiltration(WitnessFiltration(depth)).with_observations(before)
    kept = from_plain(to_plain(lived))
    assert kept.epochs == lived.epochs
    assert kept.merged.digest() == lived.merged.digest()
    grown, same = kept.with_observations(after), lived.with_observations(after)
    assert grown.merged.digest() == same.merged.digest()
    assert grown.since(3).merged.digest() == same.since(3).merged.digest()
