"""The filter: pure, tolerant of anything sound, and right where the answer is known."""

import math
from dataclasses import replace

import numpy as np
import pytest
from shapely.geometry import Polygon
from support.builders import feature, local_map, square

from homsense import (
    CountNoise,
    Delta,
    FreeSpace,
    GaussianPrior,
    HeadingPrior,
    HeightMap,
    ImuMotion,
    InvalidConfigurationError,
    InvalidInputError,
    Localizer,
    LocalizerConfig,
    OdometryMotion,
    PolygonPrior,
    PoseDistribution,
    SiteMap,
    UniformPrior,
)
from homsense.likelihood import log_likelihood

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
    assert np.array_equal(runs[0].poses, runs[1].poses)
    assert np.array_equal(runs[0].log_weights, runs[1].log_weights)
    other = localizer.start(seed=4)
    assert not np.array_equal(other.poses, localizer.start(seed=3).poses)


def test_an_older_state_stays_valid() -> None:
    localizer = _localizer()
    state = localizer.start(seed=3)
    before = state.poses.copy()
    localizer.step(state, Delta(2.0), [1, 2])
    assert np.array_equal(state.poses, before)


def test_the_posterior_is_prior_times_likelihood() -> None:
    """Without motion one step is Bayes' rule: compare with a sum over all free cells."""
    noise = CountNoise(sigma=1.0, floor=0.02)
    exact = _localizer(particles=60_000, noise=noise, resample_below=0.0, motion=OdometryMotion())
    state, pose = exact.step(exact.start(seed=1), Delta(), [2, 2])
    cells = FREE.grid.centers()[FREE.free[:-1]]
    poses = np.column_stack([cells, np.zeros(len(cells))])
    likelihood = np.exp(log_likelihood(poses, HEIGHTS, [2, 2], noise))
    likelihood /= likelihood.sum()
    edges = [np.linspace(-20.0, 220.0, 9)] * 2
    due, _ = np.histogramdd(cells, bins=edges, weights=likelihood)
    found, _ = np.histogramdd(pose.poses[:, :2], bins=edges, weights=pose.weights)
    assert 0.5 * np.abs(due - found).sum() < 0.02
    assert state.tick == 1


def test_a_short_way_makes_a_measurement_count_less() -> None:
    localizer = _localizer(noise=CountNoise(correlation_m=100.0), resample_below=0.0)
    state, _ = localizer.step(localizer.start(seed=1), Delta(), [1, 1])
    near, _ = localizer.step(state, Delta(1.0), [1, 1])
    far, _ = localizer.step(state, Delta(200.0), [1, 1])
    still, _ = localizer.step(state, Delta(), [3, 3])
    assert np.ptp(still.log_weights[still.log_weights > -10] - state.log_weights[
        still.log_weights > -10]) < 1e-9  # fmt: skip
    assert near.unweighed_m == far.unweighed_m == 0.0


def test_nothing_passes_through_a_wall() -> None:
    prior = GaussianPrior(50.0, 20.0, 1.0, HeadingPrior(0.0, 0.01))
    localizer = _localizer(prior=prior, resample_below=1.0)
    state = localizer.start(seed=1)
    _, pose = localizer.step(state, Delta(forward_m=45.0))
    assert FREE.blocked(state.poses[:, :2], state.poses[:, :2] + (45.0, 0.0)).all()
    sideways, pose = localizer.step(state, Delta(left_m=-30.0))
    assert FREE.contains(sideways.poses[:, :2]).mean() > 0.99
    assert pose.mean == pytest.approx([50.0, -10.0], abs=4.0)


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
    assert np.isfinite(state.log_weights).all()
    assert pose.ess > 1000


def test_particles_out_of_the_map_harm_nobody() -> None:
    localizer = _localizer()
    state = localizer.start(seed=1)
    lost = replace(state, poses=state.poses + np.array([1e6, 1e6, 0.0]))
    after, pose = localizer.step(lost, Delta(1.0), [1, 1])
    assert np.isfinite(after.log_weights).all()
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
        lambda: CountNoise(sigma=0.0),
        lambda: CountNoise(floor=1.0),
        lambda: CountNoise(correlation_m=math.nan),
        lambda: OdometryMotion(rotation_per_m=-0.1),
        lambda: ImuMotion(sigma_linear=math.inf),
        lambda: GaussianPrior(0.0, 0.0, 0.0),
        lambda: GaussianPrior(math.nan, 0.0, 1.0),
    ],
)
def test_a_parameter_out_of_range_is_refused(broken: object) -> None:
    with pytest.raises(InvalidConfigurationError):
        broken()  # type: ignore[operator]


def test_the_papers_imu_grows_with_the_square_of_time() -> None:
    assert ImuMotion().deviations(Delta(dt_s=2.0)) == pytest.approx((20.0, 20.0, 0.87))
    stated = OdometryMotion().deviations(Delta(5.0, std=(1.0, 2.0, 3.0)))
    assert stated == (1.0, 2.0, 3.0)


def test_priors_draw_where_they_say() -> None:
    rng = np.random.Generator(np.random.Philox(key=1))
    anywhere = UniformPrior(HeadingPrior(1.0, 0.1)).draw(FREE, 4000, rng)
    assert FREE.contains(anywhere[:, :2]).all()
    assert anywhere[:, 2].mean() == pytest.approx(1.0, abs=0.02)
    corner = Polygon([(0, -20), (40, -20), (40, 20), (0, 20)])
    inside = PolygonPrior(corner).draw(FREE, 500, rng)
    assert FREE.contains(inside[:, :2]).all()
    assert (inside[:, 0] >= 0).all()
    assert (inside[:, 0] <= 40).all()
    with pytest.raises(InvalidConfigurationError, match="free"):
        PolygonPrior(Polygon([(2, 12), (18, 12), (18, 28)])).draw(FREE, 100, rng)
    with pytest.raises(InvalidConfigurationError, match="free"):
        GaussianPrior(1e5, 1e5, 1.0).draw(FREE, 100, rng)


def test_two_places_are_two_modes_and_status_says_so() -> None:
    rng = np.random.Generator(np.random.Philox(key=2))
    left, right = rng.normal((0, 0), 3, (500, 2)), rng.normal((200, 0), 3, (500, 2))
    poses = np.column_stack([np.vstack([left, right]), np.zeros(1000)])
    weights = np.repeat([0.45, 0.55], 500) / 500
    pose = PoseDistribution(poses, weights)
    first, second = pose.modes[:2]
    assert (round(first.x_m, -1), round(second.x_m, -1)) == (200, 0)
    assert [first.weight, second.weight] == pytest.approx([0.55, 0.45])
    assert pose.covariance[0, 0] > 9000 > first.covariance[0, 0]
    even = PoseDistribution(poses, np.full(1000, 1e-3))
    assert pose.status == "tracking"
    assert PoseDistribution(poses[:, [0, 1, 2]], np.repeat([0.49, 0.51], 500) / 500).status
    assert even.modes[0].weight == pytest.approx(0.5)
    spread = np.column_stack([rng.uniform(0, 2000, (1000, 2)), np.zeros(1000)])
    assert PoseDistribution(spread, np.full(1000, 1e-3)).status == "diffuse"


def test_thinned_particles_follow_the_weights() -> None:
    poses = np.column_stack([np.arange(4.0), np.zeros(4), np.zeros(4)])
    pose = PoseDistribution(poses, np.array([0.5, 0.25, 0.25, 0.0]))
    assert pose.thinned(8).tolist() == [0, 0, 0, 0, 1, 1, 2, 2]
