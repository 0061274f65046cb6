"""The filter: pure, tolerant of anything sound, and right where the answer is known."""

import math
from dataclasses import replace

import numpy as np
import pytest
from shapely.geometry import Polygon
from support.builders import feature, local_map, square

from homsense import (
    AugmentedMcl,
    CountNoise,
    Delta,
    Doubt,
    FreeSpace,
    GaussianPrior,
    HeadingPrior,
    HeightMap,
    ImuMotion,
    InvalidConfigurationError,
    InvalidInputError,
    KldSampling,
    Localizer,
    LocalizerConfig,
    OdometryMotion,
    PolygonPrior,
    PoseDistribution,
    Prior,
    Relocation,
    SiteMap,
    UniformPrior,
)
from homsense.backend import NUMPY, Backend, compiled
from homsense.likelihood import CodeLikelihood
from homsense.motion import measured_move
from homsense.philox import random_words
from homsense.policy import always, any_of, never
from homsense.resample import SCHEMES
from homsense.stages import cells_at
from homsense.travel import FIRST_M

STREET = SiteMap.from_geojson(
    local_map(
        feature(square(0, 10, 20)),
        feature(square(60, 10, 20)),
        feature(square(160, 10, 20)),
        feature(square(-20, -20, 240), role="domain"),
    )
)
HEIGHTS = [HeightMap.geometric(STREET, r, cell_m=2.0) for r in (40.0, 80.0)]
FREE = FreeSpace.of(STREET, 2.0)
BACKENDS = [backend for backend in (NUMPY, compiled()) if backend is not None]


def _localizer(**config: object) -> Localizer:
    chosen = LocalizerConfig(**{"particles": 2000, **config})  # type: ignore[arg-type]
    return Localizer(STREET, HEIGHTS, chosen, free_space=FREE)


def test_a_step_is_a_pure_function_of_its_inputs() -> None:
    localizer = _localizer()
    runs = []
    for _ in range(2):
        state = localizer.start(seed=3)
        for _ in range(5):
            state, _ = localizer.step(state, Delta(2.0, 0.0, 0.1), [1, 2])
        runs.append(state)
    assert runs[0].digest() == runs[1].digest()
    assert localizer.start(seed=4).digest() != localizer.start(seed=3).digest()


def test_an_older_state_stays_valid() -> None:
    localizer = _localizer()
    state = localizer.start(seed=3)
    before = state.digest()
    localizer.step(state, Delta(2.0), [1, 2])
    assert state.digest() == before


def test_the_posterior_is_prior_times_likelihood() -> None:
    """Without motion one step is Bayes' rule: compare with a sum over all free cells."""
    noise = CountNoise(sigma=1.0, floor=0.02, correlation_m=FIRST_M)
    exact = _localizer(particles=60_000, noise=noise, resample_below=0.0, recovery=None)
    state, pose = exact.step(exact.start(seed=1), Delta(), [2, 2])
    centers = FREE.grid.centers()[FREE.free[:-1]]
    of_code = np.exp2(CodeLikelihood(exact.code_map, noise)([2, 2]))
    cells = cells_at(FREE.grid.raster, *centers.T.astype(np.float32))
    likelihood = of_code[exact.code_map.codes[cells]]
    likelihood /= likelihood.sum()
    edges = [np.linspace(-20.0, 220.0, 9)] * 2
    due, _ = np.histogramdd(centers, bins=edges, weights=likelihood)
    found, _ = np.histogramdd(pose.poses[:, :2], bins=edges, weights=pose.weights)
    assert 0.5 * np.abs(due - found).sum() < 0.02
    assert state.tick == 1


def test_a_short_way_makes_a_measurement_count_less() -> None:
    noise = CountNoise(correlation_m=100.0)
    localizer = _localizer(noise=noise, resample_below=0.0, recovery=None)
    state, pose = localizer.step(localizer.start(seed=1), Delta(), [1, 1])
    near, close = localizer.step(state, Delta(1.0), [3, 3])
    far, distant = localizer.step(state, Delta(100.0), [3, 3])
    still, _ = localizer.step(state, Delta(), [3, 3])
    assert still.digest() == state.digest()
    assert near.travel.length_m == far.travel.length_m == 0.0
    assert 0.0 > close.doubt.evidence_bits > 0.1 * distant.doubt.evidence_bits
    assert pose.doubt.evidence_bits < 0.0


def test_jitter_at_rest_is_not_a_way() -> None:
    localizer = _localizer()
    state, _ = localizer.step(localizer.start(seed=1), Delta(), [1, 1])
    for step in range(40):
        state, _ = localizer.step(state, Delta(0.1 if step % 2 else -0.1), [3, 3])
        assert state.travel.length_m < 0.2


def test_nothing_passes_through_a_wall() -> None:
    prior = GaussianPrior(50.0, 20.0, 1.0, HeadingPrior(0.0, 0.01))
    localizer = _localizer(prior=prior, resample_below=1.0)
    state = localizer.start(seed=1)
    _, pose = localizer.step(state, Delta(forward_m=45.0))
    assert (pose.poses[:, 0] < 60.0).all()
    sideways, pose = localizer.step(state, Delta(left_m=-30.0))
    assert FREE.contains(sideways.poses[:, :2]).mean() > 0.99
    assert pose.mean == pytest.approx([50.0, -10.0], abs=4.0)


def test_regions_are_as_wide_as_the_sensor_is_blurred() -> None:
    localizer = _localizer(prior=GaussianPrior(50.0, 20.0, 1.0))
    state, areas = localizer.start(seed=1), []
    for blur_m in (4.0, 8.0):
        sensor = CodeLikelihood(localizer.code_map, CountNoise())
        sensor.blur_m = blur_m
        blurred = Localizer(STREET, HEIGHTS, localizer.config, free_space=FREE, likelihood=sensor)
        areas.append(blurred.estimate(state).region_area_m2(0.9))
    assert areas[1] > 2.0 * areas[0]
    assert areas[0] == localizer.estimate(state).region_area_m2(0.9)


@pytest.mark.parametrize("particles", [1, 2, 7])
def test_few_particles_are_enough_to_run(particles: int) -> None:
    localizer = _localizer(particles=particles, resample_below=1.0)
    state = localizer.start(seed=2**64 - 1)
    for _ in range(20):
        state, pose = localizer.step(state, Delta(1.0, 0.0, 0.3), [0, 0])
    assert 1.0 - 1e-9 <= pose.ess <= particles + 1e-9
    assert pose.modes[0].weight > 0.0


def test_a_measurement_that_nothing_explains_harms_nobody() -> None:
    localizer = _localizer(noise=CountNoise(floor=0.0))
    state, pose = localizer.step(localizer.start(seed=1), Delta(), [1_000_000, 1_000_000])
    assert state.particles.log_weight.max() == 0
    assert pose.ess > 1000


def test_particles_out_of_the_map_harm_nobody() -> None:
    localizer = _localizer()
    state = localizer.start(seed=1)
    far = state.particles.x_m + np.float32(1e6)
    lost = replace(state, particles=state.particles._replace(x_m=far))
    after, pose = localizer.step(lost, Delta(1.0), [1, 1])
    assert after.particles.log_weight.max() == 0
    assert pose.ess > 1000


def test_a_known_start_is_tracked() -> None:
    prior = GaussianPrior(-10.0, 0.0, 2.0, HeadingPrior(0.0, 0.05))
    localizer = _localizer(prior=prior)
    state = localizer.start(seed=5)
    for step in range(40):
        here = np.array([[-10.0 + 5.0 * (step + 1), 0.0]])
        counts = [int(height.at(here)[0]) for height in HEIGHTS]
        state, pose = localizer.step(state, (5.0, 0.0, 0.0), counts)
    best = pose.modes[0]
    assert math.dist((best.x_m, best.y_m), (190.0, 0.0)) < 12.0
    assert pose.status == "tracking"
    assert abs(best.heading_rad) < 0.3
    assert best.resultant > 0.9


@pytest.mark.parametrize(
    "delta",
    [
        Delta(math.nan),
        Delta(math.inf),
        Delta(1e7),
        Delta(0.0, 0.0, -math.inf),
        Delta(1.0, dt_s=-1.0),
        Delta(1.0, std=(-1.0, 0.0, 0.0)),
        Delta(1.0, std=(math.nan, 0.0, 0.0)),
        Delta(1.0, covariance=(1.0, 0.0)),
        Delta(1.0, covariance=(-1.0, *[0.0] * 8)),
        Delta(1.0, covariance=(1.0, 2.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 1.0)),
        Delta(1.0, covariance=(1.0, 0.5, 0.0, 0.4, 1.0, 0.0, 0.0, 0.0, 1.0)),
        Delta(1.0, covariance=(0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0)),
    ],
)
def test_an_absurd_motion_is_refused(delta: Delta) -> None:
    localizer = _localizer()
    with pytest.raises(InvalidInputError):
        localizer.step(localizer.start(seed=1), delta)


@pytest.mark.parametrize("counts", [[1], [1, 2, 3], [-1, 0], [0, 10**9]])
def test_absurd_counts_are_refused(counts: list[int]) -> None:
    localizer = _localizer()
    with pytest.raises(InvalidInputError) as caught:
        localizer.step(localizer.start(seed=1), Delta(1.0), counts)
    assert caught.value.field == "counts"


@pytest.mark.parametrize("seed", [-1, 2**64])
def test_a_seed_has_64_bits(seed: int) -> None:
    with pytest.raises(InvalidInputError, match="seed"):
        _localizer().start(seed)


@pytest.mark.parametrize(
    "broken",
    [
        lambda: LocalizerConfig(particles=0),
        lambda: LocalizerConfig(particles=1_000_001),
        lambda: LocalizerConfig(resample_below=1.5),
        lambda: LocalizerConfig(scheme="best"),  # type: ignore[arg-type]
        lambda: LocalizerConfig(weigh_every_m=-1.0),
        lambda: Relocation(probability=1.0),
        lambda: AugmentedMcl(alpha_slow=0.2, alpha_fast=0.1),
        lambda: KldSampling(least=10, most=5),
        lambda: KldSampling(error=0.0),
        lambda: KldSampling(quantile=0.2),
        lambda: CountNoise(sigma=0.0),
        lambda: CountNoise(floor=1.0),
        lambda: CountNoise(correlation_m=math.nan),
        lambda: OdometryMotion(rotation_per_m=-0.1),
        lambda: ImuMotion(sigma_linear=math.inf),
        lambda: GaussianPrior(0.0, 0.0, 0.0),
        lambda: GaussianPrior(math.nan, 0.0, 1.0),
        lambda: GaussianPrior(0.0, -1e300, 1.0),
        lambda: HeadingPrior(math.nan, 0.1),
        lambda: HeadingPrior(1e300, 0.1),
        lambda: HeadingPrior(0.0, -0.1),
        lambda: HeadingPrior(0.0, math.nan),
        lambda: GaussianPrior(0.0, 0.0, 1e300),
        lambda: GaussianPrior(0.0, 0.0, math.inf),
    ],
)
def test_a_parameter_out_of_range_is_refused(broken: object) -> None:
    with pytest.raises(InvalidConfigurationError):
        broken()  # type: ignore[operator]


def test_the_papers_imu_grows_with_the_square_of_time() -> None:
    assert ImuMotion().deviations(Delta(dt_s=2.0)) == pytest.approx((20.0, 20.0, 0.87))
    stated = OdometryMotion().deviations(Delta(5.0, std=(1.0, 2.0, 3.0)))
    assert stated == (1.0, 2.0, 3.0)


def test_a_covariance_goes_before_the_model() -> None:
    covariance = (4.0, 2.0, 0.0, 2.0, 2.0, 0.0, 0.0, 0.0, 0.25)
    move = measured_move(Delta(1.0, covariance=covariance), OdometryMotion())
    triangle = np.array([*move.root[:3], *(move.root[3:] * 2 * np.pi)])
    assert triangle == pytest.approx([2.0, 1.0, 1.0, 0.0, 0.0, 0.5])


def _draw(prior: Prior, count: int) -> np.ndarray:
    return np.stack(
        prior.draw(FREE, lambda block: random_words(1, 0, block, count)), axis=1, dtype=np.float64
    )


def test_priors_draw_where_they_say() -> None:
    anywhere = _draw(UniformPrior(HeadingPrior(1.0, 0.1)), 4000)
    assert FREE.contains(anywhere[:, :2]).all()
    assert 2 * np.pi * anywhere[:, 2].mean() == pytest.approx(1.0, abs=0.02)
    corner = Polygon([(0, -20), (40, -20), (40, 20), (0, 20)])
    inside = _draw(PolygonPrior(corner), 500)
    assert FREE.contains(inside[:, :2]).all()
    assert (inside[:, 0] >= 0).all()
    assert (inside[:, 0] <= 40).all()
    with pytest.raises(InvalidConfigurationError, match="free"):
        _draw(PolygonPrior(Polygon([(2, 12), (18, 12), (18, 28)])), 100)
    with pytest.raises(InvalidConfigurationError, match="free"):
        _draw(GaussianPrior(1e5, 1e5, 1.0), 100)


def test_two_places_are_two_modes_and_status_says_so() -> None:
    rng = np.random.Generator(np.random.Philox(key=2))
    left, right = rng.normal((0, 0), 3, (500, 2)), rng.normal((200, 0), 3, (500, 2))
    poses = np.column_stack([np.vstack([left, right]), np.zeros(1000)])
    pose = PoseDistribution.of(poses, np.repeat([0.45, 0.55], 500))
    first, second = pose.modes[:2]
    assert (round(first.x_m, -1), round(second.x_m, -1)) == (200, 0)
    assert [first.weight, second.weight] == pytest.approx([0.55, 0.45], abs=1e-3)
    assert pose.covariance[0, 0] > 9000 > first.covariance[0, 0]
    even = PoseDistribution.of(poses, np.full(1000, 1e-3))
    assert pose.status == "tracking"
    assert replace(pose, doubt=Doubt(odds=3.0)).status == "suspect"
    assert even.modes[0].weight == pytest.approx(0.5)
    assert pose.holds(200.0, 0.0, 0.5)
    assert not pose.holds(100.0, 0.0, 0.95)
    spread = np.column_stack([rng.uniform(0, 2000, (1000, 2)), np.zeros(1000)])
    assert PoseDistribution.of(spread, np.full(1000, 1e-3)).status == "diffuse"


def test_thinned_particles_follow_the_weights() -> None:
    poses = np.column_stack([np.arange(4.0), np.zeros(4), np.zeros(4)])
    pose = PoseDistribution.of(poses, np.array([0.5, 0.25, 0.25, 0.0]))
    assert pose.thinned(8).tolist() == [0, 0, 0, 0, 1, 1, 2, 2]


def test_another_map_keeps_the_particles_that_it_has_room_for() -> None:
    before = _localizer(resample_below=0.0)
    state = before.start(seed=1)
    fuller = SiteMap.from_geojson(
        local_map(feature(square(0, 10, 60)), feature(square(-20, -20, 240), role="domain"))
    )
    after = Localizer(fuller, HEIGHTS, before.config)
    moved = after.migrate(state)
    free = after.free_space.contains(moved.poses[:, :2])
    assert 0.0 < free.mean() < 1.0
    assert (moved.particles.log_weight[free] == 0).all()
    assert (moved.particles.log_weight[~free] < -50_000).all()


def test_the_number_of_particles_follows_the_spread() -> None:
    here = GaussianPrior(-10.0, 0.0, 2.0, HeadingPrior(0.0, 0.05))
    adaptive = KldSampling(least=200, most=4000)
    sizes = []
    for prior in (here, UniformPrior()):
        localizer = _localizer(prior=prior, adaptive=adaptive, resample_below=1.0)
        state, _ = localizer.step(localizer.start(seed=1), Delta(1.0), [0, 0])
        sizes.append(state.particles.size)
    assert 200 <= sizes[0] < sizes[1] <= 4000


@pytest.mark.parametrize("scheme", list(SCHEMES))
def test_every_scheme_tracks(scheme: str) -> None:
    prior = GaussianPrior(-10.0, 0.0, 2.0, HeadingPrior(0.0, 0.05))
    localizer = _localizer(prior=prior, scheme=scheme, resample_below=1.0)
    state = localizer.start(seed=5)
    for _ in range(10):
        state, pose = localizer.step(state, (5.0, 0.0, 0.0), [0, 0])
    assert pose.mean == pytest.approx([40.0, 0.0], abs=6.0)


def test_a_lost_device_raises_doubt_and_is_searched_for() -> None:
    prior = GaussianPrior(70.0, 0.0, 1.0, HeadingPrior(0.0, 0.01))
    noise = CountNoise(sigma=0.5, correlation_m=5.0)
    assert [int(height.at(np.array([[70.0, 0.0]]))[0]) for height in HEIGHTS] == [1, 2]
    statuses, elsewhere = {}, {}
    for name, rule in (("standing", Relocation()), ("none", None)):
        localizer = _localizer(prior=prior, noise=noise, recovery=rule)
        state = localizer.start(seed=5)
        seen = set()
        for step in range(12):
            ahead = 2.0 if step % 2 else -2.0
            state, pose = localizer.step(state, Delta(ahead, std=(0.2, 0.2, 0.1)), [0, 0])
            seen.add(pose.status)
        statuses[name] = seen
        elsewhere[name] = (np.abs(pose.poses[:, 0] - 70.0) > 40.0).mean()
    assert "suspect" in statuses["none"]
    assert elsewhere["none"] == 0.0
    assert elsewhere["standing"] > 0.5


def test_a_policy_decides_when_to_resample() -> None:
    kept, drawn = (
        _localizer(policy=policy, recovery=None) for policy in (never, any_of(never, always))
    )
    for localizer, is_resampled in ((kept, False), (drawn, True)):
        state, pose = localizer.step(localizer.start(seed=1), Delta(), [1, 2])
        assert (pose.ess == pytest.approx(2000)) == is_resampled
        assert state.particles.log_weight.any() != is_resampled


def test_amcl_draws_anew_when_the_likelihood_falls() -> None:
    prior = GaussianPrior(70.0, 0.0, 1.0, HeadingPrior(0.0, 0.01))
    noise = CountNoise(sigma=0.5, correlation_m=5.0)
    localizer = _localizer(prior=prior, noise=noise, recovery=AugmentedMcl())
    state = localizer.start(seed=5)
    for step in range(12):
        ahead = 5.0 if step % 2 else -5.0
        counts = [1, 2] if step < 8 else [0, 0]
        state, pose = localizer.step(state, Delta(ahead, std=(0.2, 0.2, 0.1)), counts)
        assert (pose.doubt.injected > 100) == (step >= 8)


@pytest.mark.parametrize("backend", BACKENDS, ids=lambda backend: backend.name)
def test_the_bits_are_those_of_every_other_machine(backend: Backend) -> None:
    """A digest that has to be the same wherever this runs; `make proof` has CPU levels."""
    localizer = _localizer().run_by(backend)
    state = localizer.start(seed=20260101)
    for tick in range(30):
        delta = Delta(3.0, 0.1, 0.3 if tick % 7 == 0 else 0.01)
        state, _ = localizer.step(state, delta, [tick % 2, tick % 3])
    assert state.digest() == "2a9e0d39cdfd1eb0"
