"""The particles against the exact posterior."""

from statistics import mean

import numpy as np
import pytest
from support.builders import feature, local_map, square
from support.point_mass import PointMassFilter

from homsense import (
    CountNoise,
    Delta,
    FreeSpace,
    HeightMap,
    Localizer,
    LocalizerConfig,
    SiteMap,
)
from homsense.likelihood import CodeLikelihood

TOWN = SiteMap.from_geojson(
    local_map(
        *(feature(square(*place)) for place in ((0, 0, 30), (75, 5, 30), (10, 90, 20))),
        feature(square(-20, -20, 150), role="domain"),
    )
)
FREE = FreeSpace.of(TOWN, 2.0)
HEIGHTS = [HeightMap.geometric(TOWN, r, cell_m=2.0) for r in (50.0, 90.0)]
NOISE = CountNoise(sigma=1.0, correlation_m=6.0)
STEP = Delta(3.0, 0.0, 0.05, std=(0.8, 0.8, 0.12))
COUNTS = [(1, 2), (1, 2), (1, 1), (0, 1), (0, 1), (0, 2), (1, 2), (1, 3)]
SQUARE = 6


def _exact() -> np.ndarray:
    oracle = PointMassFilter(FREE)
    localizer = Localizer(TOWN, HEIGHTS, LocalizerConfig(noise=NOISE), free_space=FREE)
    weigh = CodeLikelihood(localizer.code_map, NOISE)
    raster = FREE.grid.raster
    codes = localizer.code_map.codes.reshape(raster.rows, raster.columns)[1:-1, 1:-1]
    exponent = 1.0
    for counts in COUNTS:
        oracle.move(STEP)
        oracle.weigh(np.exp2(exponent * weigh(counts))[codes])
        exponent = STEP.length_m / NOISE.correlation_m
    return oracle.histogram(SQUARE)


def _apart(exact: np.ndarray, particles: int, seed: int, **config: object) -> float:
    chosen = LocalizerConfig(particles, noise=NOISE, recovery=None, **config)  # type: ignore[arg-type]
    localizer = Localizer(TOWN, HEIGHTS, chosen, free_space=FREE)
    state = localizer.start(seed)
    for counts in COUNTS:
        state, pose = localizer.step(state, STEP, counts)
    rows, columns = exact.shape
    side = SQUARE * FREE.grid.cell_m
    edges = [-20.0 + side * np.arange(columns + 1), -20.0 + side * np.arange(rows + 1)]
    found, _, _ = np.histogram2d(
        pose.poses[:, 0], pose.poses[:, 1], bins=edges, weights=pose.weights
    )
    return float(0.5 * np.abs(found.T - exact).sum())


def test_the_posterior_converges_to_the_exact_one() -> None:
    exact = _exact()
    apart = [
        mean(_apart(exact, particles, seed) for seed in range(4))
        for particles in (500, 2000, 8000, 32_000)
    ]
    assert apart == sorted(apart, reverse=True)
    assert apart[2] < 0.10
    assert apart[3] < 0.06


@pytest.mark.parametrize("scheme", ["systematic", "stratified", "residual", "multinomial"])
def test_every_scheme_has_the_same_posterior(scheme: str) -> None:
    exact = _exact()
    seeds = range(1, 9)
    assert mean(_apart(exact, 8000, n, scheme=scheme, resample_below=1.0) for n in seeds) < 0.15
