"""Is the posterior honest, and is a kidnapped device found? Over seeded runs in a town.

The count process is synthetic and known: expected counts at the true place, plus an error that is
an autoregressive field along the way, rounded. Truth must lie inside the 90 % region in 85 to 97 %
of the steps and inside the 50 % region in 42 to 65 %. A device that is put elsewhere must be found
again within 400 m in at least 60 % of the runs, and nobody must be lost because of that search: a
filter that has to find somebody again takes twice the true error of the motion, one that is to be
honest a quarter more: 8000 particles are thin before the first places are ruled out.
"""

import math
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from typing import NamedTuple

import numpy as np
from filters import Town, town

from homsense import (
    CountNoise,
    Delta,
    FreeSpace,
    HeightMap,
    Localizer,
    LocalizerConfig,
    Relocation,
)

RUNS, STEP_M, STEPS, KIDNAPPED_AT, FOUND_M, WITHIN_M, LAST = 200, 4.0, 240, 160, 400.0, 50.0, 20
ERROR, CORRELATION, RADII_M = 1.4, 0.7, (80.0, 120.0, 160.0, 200.0)
CORRELATION_M = STEP_M / -math.log(CORRELATION)
NOISE = CountNoise(sigma=1.5, floor=0.002, correlation_m=2.0 * CORRELATION_M)
STD = (0.64, 0.64, 0.04)
HALF, MOST, AT_LEAST, LOSS = (0.42, 0.65), (0.85, 0.97), 0.6, 0.05
RNG = np.random.Generator


class Outcome(NamedTuple):
    """What became of one run."""

    in_50: float
    in_90: float
    in_95: float
    found: float


class Scene(NamedTuple):
    """How runs differ; the filter is told `inflation` times the true error of the motion."""

    name: str
    relocation: float
    inflation: float
    is_kidnapped: bool


HONEST = Scene("nobody kidnapped", 0.05, 1.25, is_kidnapped=False)
ALONE = Scene("nobody kidnapped, no relocation", 0.0, 2.0, is_kidnapped=False)
SEARCHING = Scene("nobody kidnapped", 0.05, 2.0, is_kidnapped=False)
LOST = Scene("kidnapped, no relocation", 0.0, 2.0, is_kidnapped=True)
RECOVERED = Scene("kidnapped", 0.05, 2.0, is_kidnapped=True)
SCENES = (HONEST, ALONE, SEARCHING, LOST, RECOVERED)


@cache
def _town() -> Town:
    """Return the town of the benchmark with what four neighborhoods expect in it."""
    site_map = town().site_map
    heights = [HeightMap.geometric(site_map, radius, cell_m=2.0) for radius in RADII_M]
    return Town(site_map, heights, FreeSpace.of(site_map, 2.0))


def drive(here: Town, rng: RNG, steps: int) -> Iterator[tuple[np.ndarray, float, float]]:
    """Yield places, turns and lengths of a device that wanders through free space."""
    place = here.free_space.grid.centers()[rng.choice(np.flatnonzero(here.free_space.free[:-1]))]
    heading = rng.uniform(-math.pi, math.pi)
    yield place, heading, 0.0
    for _ in range(steps):
        for spread in (0.1, 0.5, 1.5, math.pi, math.pi, math.pi, math.pi):
            turn = rng.normal(0.0, spread)
            ahead = place + STEP_M * np.array([math.cos(heading + turn), math.sin(heading + turn)])
            between = place + np.linspace(0.0, 1.0, 9)[:, None] * (ahead - place)
            if here.free_space.contains(between).all():
                place, heading = ahead, heading + turn
                yield place, turn, STEP_M
                break
        else:
            yield place, 0.0, 0.0


def run(scene: Scene, seed: int) -> Outcome:
    """Return what becomes of one device."""
    here, rng = _town(), np.random.Generator(np.random.Philox(key=seed))
    recovery = Relocation(scene.relocation) if scene.relocation else None
    config = LocalizerConfig(noise=NOISE, recovery=recovery)
    along, across, around = (scene.inflation * deviation for deviation in STD)
    localizer = Localizer(here.site_map, here.heights, config, free_space=here.free_space)
    state = localizer.start(seed)
    error = rng.normal(0.0, ERROR, len(here.heights))
    inside, near = np.zeros((STEPS, 3)), []
    legs = list(drive(here, rng, STEPS))[1:]
    if scene.is_kidnapped:
        elsewhere = int(STEPS + FOUND_M / STEP_M) - KIDNAPPED_AT
        legs = legs[:KIDNAPPED_AT] + list(drive(here, rng, elsewhere))[1:]
        inside = np.zeros((len(legs), 3))
    for tick, (place, turn, length) in enumerate(legs):
        error = CORRELATION * error + math.sqrt(1 - CORRELATION**2) * rng.normal(
            0.0, ERROR, len(error)
        )
        due = np.array([height.at(place[None])[0] for height in here.heights])
        counts = np.maximum(np.rint(due + error), 0).astype(int).tolist()
        noise = rng.normal(0.0, STD)
        delta = _as_odometry(length, turn, noise)._replace(std=(along, across, around))
        state, pose = localizer.step(state, delta, counts)
        inside[tick] = [pose.holds(place[0], place[1], level) for level in (0.5, 0.9, 0.95)]
        best = pose.modes[0]
        near.append(math.dist((best.x_m, best.y_m), place) < WITHIN_M)
    half, most, nearly_all = inside.mean(axis=0)
    return Outcome(half, most, nearly_all, float(sum(near[-LAST:]) > LAST / 2))


def _as_odometry(length: float, turn: float, noise: np.ndarray) -> Delta:
    """Return the motion as measured: turned first, then straight on."""
    forward, left = length * math.cos(turn) + noise[0], length * math.sin(turn) + noise[1]
    return Delta(forward, left, turn + noise[2])


def table(runs: int = RUNS) -> tuple[list[str], bool]:
    """Return the table, and whether everything is as it must be."""
    rows = [
        (
            f"{runs} runs of {STEPS * STEP_M:.0f} m, unknown start and heading, 8000 particles; "
            f"count error {ERROR} holes, correlated by {CORRELATION} from step to step of "
            f"{STEP_M:.0f} m; motion error {STD[0]} m and {STD[2]} rad a step; the filter takes "
            f"sigma {NOISE.sigma} and a correlation of {NOISE.correlation_m:.0f} m."
        ),
        "",
        (
            "| scene | relocation | motion error, to the true one | truth in 50 % | in 90 % "
            "| in 95 % | within 50 m at the end |"
        ),
        "|---|---|---|---|---|---|---|",
    ]
    shares: dict[Scene, Outcome] = {}
    with ProcessPoolExecutor(2) as pool:
        for scene in SCENES:
            found = list(pool.map(run, [scene] * runs, range(runs), chunksize=5))
            share = [float(np.mean(part)) for part in zip(*found, strict=True)]
            shares[scene] = Outcome(*share)
            numbers = " | ".join(f"{part:.0%}" for part in share)
            rows.append(f"| {scene.name} | {scene.relocation} | {scene.inflation} | {numbers} |")
    honest = shares[HONEST]
    good = (
        HALF[0] <= honest.in_50 <= HALF[1]
        and MOST[0] <= honest.in_90 <= MOST[1]
        and shares[RECOVERED].found >= AT_LEAST
        and shares[SEARCHING].found >= shares[ALONE].found - LOSS
    )
    return rows, good


def main() -> int:
    """Print the table; return the exit code."""
    rows, good = table(int(sys.argv[1]) if len(sys.argv) > 1 else RUNS)
    print("\n".join(rows))
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
