"""Laws of the filter: both backends have the same bits, weights are exact, modes are hills."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import kstest
from shapely.geometry import LineString
from support.builders import feature, local_map, square
from support.strategies import FINITE

from homsense import (
    CountNoise,
    Delta,
    Doubt,
    FreeSpace,
    HeadingPrior,
    HeightMap,
    Localizer,
    LocalizerConfig,
    OdometryMotion,
    Particles,
    PoseDistribution,
    Relocation,
    SiteMap,
    exact,
)
from homsense.backend import NUMPY, Backend, compiled
from homsense.histogram import KEY_BITS, heaviest_first
from homsense.likelihood import CodeLikelihood
from homsense.modes import ACCURACY_SHARE, FARTHEST, MAX_MODES
from homsense.motion import measured_move
from homsense.philox import random_words
from homsense.resample import SCHEMES, strides
from homsense.stages import cells_at
from homsense.weights import FULL, linear, sums, units

TOWN = SiteMap.from_geojson(
    local_map(
        *(feature(square(70 * i, 70 * j, 30)) for i in range(3) for j in range(3)),
        feature(square(-20, -20, 210), role="domain"),
    )
)
FREE = FreeSpace.of(TOWN, 2.0)
HEIGHTS = [HeightMap.geometric(TOWN, r, cell_m=2.0) for r in (60.0, 100.0)]
BACKENDS = [backend for backend in (NUMPY, compiled()) if backend is not None]
SEEDS = st.integers(0, 2**64 - 1)
DELTAS = st.builds(
    Delta,
    st.floats(-40.0, 40.0),
    st.floats(-40.0, 40.0),
    st.floats(-10.0, 10.0),
    dt_s=st.just(1.0),
    std=st.tuples(*[st.floats(0.0, 30.0)] * 3),
    covariance=st.none(),
)
LOG_WEIGHTS = arrays(np.int32, st.integers(1, 60), elements=st.integers(-60_000, 0)).map(
    lambda lows: lows - lows.max()
)
WEIGHTS = LOG_WEIGHTS.map(linear)


def _somewhere(seed: int, count: int) -> Particles:
    words = random_words(seed, 0, 3, count)
    x, y = FREE.draw(words[:3])
    turns = exact.wrap_turns(exact.unit_interval(words[3]))
    log_weight = -(words[0] >> np.uint32(18)).astype(np.int32)
    return Particles(x, y, turns, log_weight - log_weight.max())


@given(
    SEEDS,
    st.lists(st.tuples(DELTAS, st.none() | st.tuples(st.integers(0, 9), st.integers(0, 9))),
             min_size=1, max_size=6),
    st.integers(1, 300),
    st.sampled_from(list(SCHEMES)),
)  # fmt: skip
def test_both_backends_have_the_same_bits(
    seed: int,
    inputs: list[tuple[Delta, tuple[int, int] | None]],
    count: int,
    scheme: str,
) -> None:
    config = LocalizerConfig(particles=count, scheme=scheme)  # type: ignore[arg-type]
    one = Localizer(TOWN, HEIGHTS, config, free_space=FREE, backend=NUMPY)
    other = one.run_by(BACKENDS[-1])
    state = one.start(seed)
    turned = other.start(seed)
    for tick, (delta, counts) in enumerate(inputs):
        assert state.digest() == turned.digest()
        assert (state.doubt, state.travel) == (turned.doubt, turned.travel)
        if tick % 2:
            state, turned = turned, state
        state, pose = one.step(state, delta, counts)
        turned, same = other.step(turned, delta, counts)
        assert np.array_equal(pose.density, same.density)
        assert [repr(mode) for mode in pose.modes] == [repr(mode) for mode in same.modes]
    assert state.digest() == turned.digest()


@pytest.mark.parametrize("backend", BACKENDS, ids=lambda backend: backend.name)
@given(SEEDS, DELTAS, st.integers(0, 2**64 - 1))
def test_no_particle_passes_through_a_building(
    backend: Backend, seed: int, delta: Delta, tick: int
) -> None:
    before = _somewhere(seed, 40)
    after = backend.propagate(
        before, measured_move(delta, OdometryMotion()), FREE.walls, seed, tick
    )
    assert FREE.contains(after.poses[:, :2]).all()
    for start, end in zip(before.poses[:, :2], after.poses[:, :2], strict=True):
        way = LineString([start, end])
        for structure in TOWN.structures:
            assert way.intersection(structure).length < 1.0 + FREE.grid.cell_m * math.sqrt(2.0)


@given(SEEDS, DELTAS)
def test_a_full_turn_of_the_headings_changes_nothing(seed: int, delta: Delta) -> None:
    before = _somewhere(seed, 50)
    move = measured_move(delta, OdometryMotion())
    once = NUMPY.propagate(before, move, FREE.walls, seed, 1)
    turned = exact.wrap_turns(before.turns + np.float32(1.0))
    again = NUMPY.propagate(before._replace(turns=turned), move, FREE.walls, seed, 1)
    near = np.abs(once.poses[:, :2] - again.poses[:, :2]).max(axis=1) < 0.01
    assert near.mean() >= 0.9  # one that just touches a wall may stop


@given(SEEDS, st.floats(-3.0, 3.0), st.integers(-1000, 1000), st.floats(1e-3, 10.0))
def test_a_compass_that_counts_turns_says_the_same(
    seed: int, mean_rad: float, turns: int, std_rad: float
) -> None:
    words = np.random.Generator(np.random.Philox(seed)).integers(
        0, 2**32, (4, 50), dtype=np.uint32
    )
    once = HeadingPrior(mean_rad, std_rad).draw(words)
    again = HeadingPrior(mean_rad + turns * math.tau, std_rad).draw(words)
    assert np.abs(exact.wrap_turns(once - again)).max() < 1e-6


@given(arrays(np.float32, 40, elements=st.floats(-1e6, 1e6, width=32)))
def test_wrapping_keeps_the_direction(turns: np.ndarray) -> None:
    wrapped = exact.wrap_turns(turns)
    assert ((wrapped >= -0.5) & (wrapped <= 0.5)).all()
    apart = turns.astype(np.float64) - wrapped
    assert np.abs(apart - np.round(apart)).max() < 1e-6


@given(st.integers(0, 2**32 - 1))
def test_polynomials_agree_with_the_library(seed: int) -> None:
    words = random_words(seed, 1, 0, 500)
    unit = exact.unit_interval(words[0])
    squared = -2.0 * np.log(unit.astype(np.float64))
    assert exact.squared_radius(words[0]) == pytest.approx(squared, rel=2e-6)
    turns = exact.wrap_turns(unit)
    angle = 2 * np.pi * unit.astype(np.float64)
    assert np.abs(exact.sine(turns) - np.sin(angle)).max() < 3e-7
    assert np.abs(exact.cosine(turns) - np.cos(angle)).max() < 3e-7
    numbers = -700.0 * unit.astype(np.float64)
    assert exact.exp(numbers) == pytest.approx(np.exp(numbers), rel=1e-14)
    assert exact.log2(np.exp(numbers)) == pytest.approx(np.log2(np.exp(numbers)), abs=1e-12)


def test_random_deviates_are_normal_and_independent() -> None:
    normals = exact.standard_normals(random_words(5, 7, 0, 200_000))
    assert normals.mean(axis=1) == pytest.approx([0.0] * 4, abs=0.01)
    assert np.cov(normals) == pytest.approx(np.eye(4), abs=0.01)
    assert (normals**4).mean(axis=1) == pytest.approx([3.0] * 4, abs=0.06)
    assert np.cov(normals**2) == pytest.approx(2.0 * np.eye(4), abs=0.06)
    assert kstest(normals.ravel(), "norm").pvalue > 0.01


@given(SEEDS, st.integers(0, 2**64 - 1), st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 9))
def test_random_words_are_those_of_their_numbers(
    seed: int, tick: int, purpose: int, first: int
) -> None:
    together = random_words(seed, tick, purpose, 8, first)
    for nth in range(8):
        alone = random_words(seed, tick, purpose, 1, first + nth)
        assert np.array_equal(alone[:, 0], together[:, nth])


@given(LOG_WEIGHTS)
def test_weights_are_two_to_the_power_of_their_logarithm(log_weight: np.ndarray) -> None:
    assert linear(log_weight) == pytest.approx(FULL * np.exp2(log_weight / 2048), abs=1.0)
    summed = sums(linear(log_weight))
    assert 1.0 <= summed.ess <= summed.size + 1e-9


@given(LOG_WEIGHTS, st.integers(-1000, 1000))
def test_adding_a_constant_to_log_weights_changes_nothing(
    log_weight: np.ndarray, constant: int
) -> None:
    particles = _somewhere(1, len(log_weight))._replace(log_weight=log_weight)
    codes, table = np.zeros(FREE.walls.clearance.size, np.uint16), np.array([constant], np.int32)
    for backend in BACKENDS:
        found = backend.reweigh(particles, FREE.grid.raster, codes, table)
        assert np.array_equal(found.particles.log_weight, log_weight)
        assert (found.gain, found.before) == (constant, found.summed.total)
        weights, summed = backend.weigh(found.particles)
        assert (found.weights.tolist(), found.summed) == (weights.tolist(), summed)


@given(LOG_WEIGHTS, st.integers(1, 200))
def test_thinned_particles_are_a_systematic_sample(log_weight: np.ndarray, count: int) -> None:
    pose = PoseDistribution(_somewhere(1, len(log_weight))._replace(log_weight=log_weight))
    weights, summed = linear(log_weight), sums(linear(log_weight))
    drawn = strides(weights, summed.total, summed.total // 2, count)
    assert pose.thinned(count).tolist() == drawn.tolist()


@pytest.mark.parametrize("scheme", SCHEMES)
@given(WEIGHTS, SEEDS, st.integers(1, 80))
def test_a_scheme_draws_only_what_has_weight(
    scheme: str, weights: np.ndarray, seed: int, count: int
) -> None:
    drawn = SCHEMES[scheme](weights, random_words(seed, 1, 1, count), count)
    times = np.bincount(drawn, minlength=len(weights))
    due = count * weights / weights.sum()
    assert len(drawn) == count
    assert (np.diff(drawn) >= 0).all()
    assert not times[weights == 0].any()
    if scheme in ("systematic", "residual"):
        assert (times >= np.floor(due - 1e-9)).all()
    if scheme == "systematic":
        assert (times <= np.ceil(due + 1e-9)).all()
    if scheme == "stratified":
        assert (np.abs(times - due) < 2.0).all()


@pytest.mark.parametrize("scheme", SCHEMES)
def test_mean_offspring_is_the_weight(scheme: str) -> None:
    weights = (np.array([0.55, 0.25, 0.12, 0.08]) * FULL).astype(np.uint32)
    draw = SCHEMES[scheme]
    times = [
        np.bincount(draw(weights, random_words(seed, 1, 1, 7), 7), minlength=4)
        for seed in range(20_000)
    ]
    assert np.mean(times, axis=0) == pytest.approx(7 * weights / weights.sum(), abs=0.03)


@pytest.mark.parametrize("backend", BACKENDS, ids=lambda backend: backend.name)
@given(WEIGHTS, st.integers(1, 90), st.floats(0.0, 1.0, exclude_max=True), st.integers(0, 9))
def test_a_backend_draws_as_the_scheme_does_and_others_join(
    backend: Backend, weights: np.ndarray, count: int, part: float, joining: int
) -> None:
    particles = _somewhere(2, len(weights))
    x, y, turns, _ = _somewhere(3, 9)
    fresh = Particles(x[:joining], y[:joining], turns[:joining], np.zeros(joining, np.int32))
    total = int(weights.sum())
    drawn = backend.systematic(particles, weights, total, int(part * total), count, fresh)
    same = NUMPY.systematic(particles, weights, total, int(part * total), count, fresh)
    assert drawn.size == count + joining
    assert drawn.x_m[count:].tolist() == fresh.x_m.tolist()
    assert not drawn.log_weight.any()
    assert drawn.digest() == same.digest()


@given(
    arrays(np.float64, (60, 2), elements=st.floats(-200.0, 200.0)),
    arrays(np.float64, 60, elements=st.floats(0.001, 1.0)),
    st.permutations(range(60)),
)
def test_modes_share_the_mass_whatever_the_order(
    places: np.ndarray, weights: np.ndarray, order: list[int]
) -> None:
    poses = np.column_stack([places, np.zeros(60)])
    pose = PoseDistribution.of(poses, weights)
    shared = sum(mode.weight for mode in pose.modes)
    assert shared <= 1.0 + 1e-9
    assert len(pose.modes) == MAX_MODES or shared == pytest.approx(1.0)
    assert [mode.weight for mode in pose.modes] == sorted(
        (mode.weight for mode in pose.modes), reverse=True
    )
    for mode in pose.modes:
        assert np.linalg.eigvalsh(mode.covariance).min() >= -1e-6
        assert mode.accuracy_m >= 0.0
    areas = [pose.region_area_m2(level) for level in (0.5, 0.9, 0.95)]
    assert areas == sorted(areas)
    assert pose.density.sum() == pytest.approx(1.0)
    again = PoseDistribution.of(poses[order], weights[order])
    assert np.array_equal(again.density, pose.density)
    assert [mode.weight for mode in again.modes] == [mode.weight for mode in pose.modes]


@pytest.mark.parametrize("backend", BACKENDS, ids=lambda backend: backend.name)
@given(arrays(np.int64, (9, 11), elements=st.sampled_from([0, 1, 2, 5, 9, 30])))
def test_a_mode_is_a_hill(backend: Backend, mass: np.ndarray) -> None:
    smooth = np.pad(mass, 1)
    flat, order = smooth.ravel(), heaviest_first(smooth.ravel())
    hills = backend.hills(smooth, order)
    assert np.array_equal(hills, NUMPY.hills(smooth, order))
    assert (hills <= np.arange(len(order))).all()
    for peak in np.unique(hills):
        assert hills[peak] == peak
        assert flat[order[peak]] == flat[order[hills == peak]].max()


@pytest.mark.parametrize("backend", BACKENDS, ids=lambda backend: backend.name)
@given(SEEDS, st.integers(1, 200))
def test_modes_are_numbered_by_falling_mass_and_the_lightest_are_left(
    backend: Backend, seed: int, size: int
) -> None:
    particles = _somewhere(seed, size)
    weights, _ = backend.weigh(particles)
    found = backend.histogram(particles, weights, 5.0)
    assert np.array_equal(found.order, heaviest_first(found.smooth.ravel()))
    hills = backend.hills(found.smooth, found.order)
    of_mode, n_modes = backend.label(found, weights, hills)
    assert np.array_equal(of_mode, NUMPY.label(found, weights, hills)[0])
    mass = np.bincount(of_mode, weights, n_modes + 1)
    n_hills = len(np.unique(hills))
    assert (np.diff(mass[:-1]) <= 0).all()
    assert n_modes == min(n_hills, MAX_MODES)
    if n_hills <= MAX_MODES:
        assert mass[-1] == 0.0
    else:
        by_hill = np.zeros(len(hills) + 1)
        place = np.full(found.smooth.size, len(hills))
        place[found.order] = hills
        np.add.at(by_hill, place[found.cells], weights)
        assert mass[:-1].tolist() == sorted(by_hill, reverse=True)[:MAX_MODES]


@pytest.mark.parametrize("backend", BACKENDS, ids=lambda backend: backend.name)
@given(SEEDS, st.integers(1, 200), st.integers(1, 3), st.sampled_from([0.0, 1e-3, 1.0, 1e3]))
def test_the_accuracy_is_the_radius_that_holds_its_share(
    backend: Backend, seed: int, size: int, n_modes: int, spread: float
) -> None:
    x, y, turns, log_weight = _somewhere(seed, size)
    particles = Particles(x * np.float32(spread), y * np.float32(spread), turns, log_weight)
    weights, _ = backend.weigh(particles)
    of_mode = np.arange(size) % n_modes
    found = backend.moments(particles, weights, of_mode, n_modes, np.zeros(2))
    same = NUMPY.moments(particles, weights, of_mode, n_modes, np.zeros(2))
    assert all(map(np.array_equal, found, same))
    for mode, radius in enumerate(found.accuracy_m[:-1].tolist()):
        mine = of_mode == mode
        places = np.column_stack([particles.x_m, particles.y_m])[mine].astype(np.float64)
        if not weights[mine].any():
            continue
        distance = np.hypot(*(places - np.average(places, axis=0, weights=weights[mine])).T)
        needed = ACCURACY_SHARE * weights[mine].sum()
        bin_m = FARTHEST * math.sqrt(np.average(distance**2, weights=weights[mine])) / 255
        slack = 1e-6 * spread
        assert weights[mine][distance <= radius + slack].sum() >= needed - 1e-6
        assert weights[mine][distance < radius - bin_m - slack].sum() < needed


@given(SEEDS)
def test_a_region_holds_its_share_with_the_fewest_cells(seed: int) -> None:
    pose = PoseDistribution(_somewhere(seed, 30))
    for level in (0.5, 0.9):
        inside = pose.region(level)
        assert pose.density[inside].sum() >= level - 1e-12
        assert pose.density[inside].min() >= pose.density[~inside].max()
        assert pose.density[inside].sum() - pose.density[inside].min() < level + 1e-12


@given(arrays(np.int64, 35, elements=st.integers(0, 9)), st.sampled_from([1, 2**40, 2**58]))
def test_the_heaviest_cells_come_first_and_of_equals_the_first(
    smooth: np.ndarray, unit: int
) -> None:
    mass = smooth.tolist()
    assert heaviest_first(smooth * unit).tolist() == sorted(
        np.flatnonzero(mass), key=lambda cell: (-mass[cell], cell)
    )


def test_masses_too_large_to_be_sorted_with_their_index_are_sorted_all_the_same() -> None:
    x = np.where(np.arange(2**20) < 2**20 - 1, 1.0, 1900.0).astype(np.float32)
    particles = Particles(x, x, x, np.zeros(len(x), np.int32))
    weights = np.full(len(x), FULL, np.uint32)
    found = [backend.histogram(particles, weights, 4.0) for backend in BACKENDS]
    for one in found:
        assert int(one.smooth.max()).bit_length() + one.smooth.size.bit_length() > KEY_BITS
        assert np.array_equal(one.order, found[0].order)
        assert one.smooth.ravel()[one.order].tolist() == sorted(
            one.smooth[one.smooth > 0].tolist(), reverse=True
        )


@given(FINITE, FINITE, FINITE)
def test_a_sound_motion_passes_its_check(forward: float, left: float, turn: float) -> None:
    delta = Delta(forward, left, turn)
    assert delta.checked() is delta


@given(st.tuples(st.integers(0, 3), st.integers(0, 6)), SEEDS)
def test_new_particles_come_from_the_likelihood(counts: tuple[int, int], seed: int) -> None:
    localizer = Localizer(TOWN, HEIGHTS, free_space=FREE, backend=NUMPY)
    code_map = localizer.code_map
    cells, likelihood = code_map.coded_cells, CodeLikelihood(code_map, CountNoise())(counts)
    masses, *others = [b.cell_masses(cells, units(likelihood)) for b in BACKENDS]
    drawn, *repeated = [b.draw(cells, masses, seed, 1, 5000) for b in BACKENDS]
    for other, again in zip(others, repeated, strict=True):
        assert np.array_equal(other.of_code, masses.of_code)
        assert other.evidence_bits == masses.evidence_bits
        assert again.digest() == drawn.digest()
    assert FREE.contains(drawn.poses[:, :2]).all()
    codes = code_map.codes[cells_at(FREE.grid.raster, drawn.x_m, drawn.y_m)]
    found = np.bincount(codes, minlength=len(likelihood)) / 5000
    due = code_map.sizes * np.exp2(likelihood)
    assert 0.5 * np.abs(found - due / due.sum()).sum() < 0.05
    mean = due.sum() / code_map.sizes.sum()
    assert masses.evidence_bits == pytest.approx(np.log2(mean), abs=1e-3)


@given(st.floats(0.0, 0.9), st.floats(-30.0, 30.0), st.floats(0.0, 1.0), st.floats(0.0, 100.0))
def test_the_doubt_follows_bayes_rule(
    probability: float, advantage: float, exponent: float, odds: float
) -> None:
    doubt = Doubt(advantage_bits=advantage, odds=odds)
    after, share = Relocation(probability).share(doubt, exponent)
    prior = probability * exponent
    lost, kept = prior * 2.0**-advantage, 1.0 - prior
    assert share == pytest.approx(lost / (lost + kept))
    assert after.odds == pytest.approx(min((odds + prior) * 2.0**-advantage / (1.0 - prior), 1e9))
    assert 0.0 <= after.relocation_p <= 1.0
