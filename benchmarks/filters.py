"""One step of the filter: ours against `particles` and `pfilter`, CPU time, same run.

Everyone gets the same town, start, motions and counts, and the same look-up likelihood, and
resamples systematically at every step. As a localizer, ours also stops particles at walls and
keeps a standing relocation hypothesis; the peers take no such care, so ours is measured without
either, too. Rounds are interleaved; figures are the median step of the best round, for everyone,
since neighbors on the machine disturb whole rounds.
"""

import json
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import NamedTuple

import numpy as np

from homsense import (
    CountNoise,
    Delta,
    FreeSpace,
    GaussianPrior,
    HeadingPrior,
    HeightMap,
    Localizer,
    LocalizerConfig,
    Relocation,
    SiteMap,
    UniformPrior,
)
from homsense.backend import NUMPY, Backend, compiled
from homsense.recovery import Recovery

SEED, ROUNDS, STEPS, WARM_STEPS = 1, 15, 25, 5
SIZES = (1000, 8000, 50_000)
PEERS = Path(".venv-peers", "bin", "python")
DELTA = Delta(5.0, 0.0, 0.02, std=(0.8, 0.8, 0.05))
_START, _STRIDE_M = (70.0, 300.0), 0.6
_STANDING = Relocation()
_WORK = {"what the peers do": False, "walls and relocation, too": True}
NOISE = CountNoise(sigma=3.0, floor=0.02, correlation_m=5.0)


class Town(NamedTuple):
    """A map of 44 buildings with its height maps."""

    site_map: SiteMap
    heights: list[HeightMap]
    free_space: FreeSpace


def town() -> Town:
    """Return the town: 640 m square, 44 blocks of 28 to 58 m near the places of a grid of 90 m."""
    rng = np.random.Generator(np.random.Philox(key=SEED))
    missing = {(0, 0), (3, 3), (6, 1), (2, 5), (5, 6)}
    places = [(i, j) for i in range(7) for j in range(7) if (i, j) not in missing]
    blocks = []
    for i, j in places:
        wide, high = rng.uniform(28.0, 58.0, 2)
        west, south = (
            5.0 + 90.0 * np.array([i, j]) + rng.uniform(0.0, 78.0 - np.array([wide, high]))
        )
        blocks.append(_feature(west, south, wide, high, {}))
    document = {
        "type": "FeatureCollection",
        "frame": "local",
        "features": [*blocks, _feature(0, 0, 640, 640, {"role": "domain"})],
    }
    site_map = SiteMap.from_geojson(document)
    heights = [HeightMap.geometric(site_map, r, cell_m=1.0) for r in (120.0, 180.0)]
    return Town(site_map, heights, FreeSpace.of(site_map, 1.0))


def _feature(
    x: float, y: float, wide: float, high: float, properties: dict[str, str]
) -> dict[str, object]:
    ring = [[x, y], [x + wide, y], [x + wide, y + high], [x, y + high], [x, y]]
    geometry = {"type": "Polygon", "coordinates": [ring]}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def table() -> list[str]:
    """Return the table of steps."""
    here = town()
    backends = [backend for backend in (compiled(), NUMPY) if backend is not None]
    rows = [
        (
            f"Seed {SEED}, a town of {len(here.site_map.structures)} buildings on 640 m, cells of "
            f"1 m, {ROUNDS} interleaved rounds of {STEPS} steps, systematic resampling at every "
            "step; CPU microseconds a step, the median of the best round, and how many times ours "
            "(numba) goes into it."
        ),
        "",
        "| size | done | ours, numba | ours, numpy | `particles` | `pfilter` | numpy to it |",
        "|---|---|---|---|---|---|---|",
    ]
    with _peers(here) as ask:
        for size in SIZES:
            theirs: list[dict[str, float]] = []
            ours: dict[str, list[dict[str, float]]] = {work: [] for work in _WORK}
            for _ in range(ROUNDS):
                theirs.append(ask(size))
                for work, whole in _WORK.items():
                    spent = {b.name: _step_s(here, b, size, whole=whole) for b in backends}
                    ours[work].append(spent)
            rows += [
                f"| {size} | {work} " + _row(size, rounds, theirs) for work, rounds in ours.items()
            ]
    return [*rows, "", *summary_table(here)]


def _row(size: int, ours: list[dict[str, float]], theirs: list[dict[str, float]]) -> str:
    us = {
        name: 1e6 * min(one[name] for one in rounds)
        for rounds in (ours, theirs)
        for name in rounds[0]
    }
    fast = us["numba"]
    return (
        f"| {fast:.0f} ({1e3 * fast / size:.1f} ns a particle) "
        f"| {us['numpy']:.0f} = {us['numpy'] / fast:.1f} x "
        f"| {us['particles']:.0f} = **{us['particles'] / fast:.1f} x** "
        f"| {us['pfilter']:.0f} = **{us['pfilter'] / fast:.1f} x** "
        f"| **{us['particles'] / us['numpy']:.1f} x** |"
    )


def _localizer(
    here: Town,
    backend: Backend | None,
    size: int,
    *,
    known: bool = False,
    recovery: Recovery | None = _STANDING,
    walls: bool = True,
) -> Localizer:
    known_prior = GaussianPrior(*_START, 4.0, HeadingPrior(0.0, 0.1))
    config = LocalizerConfig(
        particles=size,
        noise=NOISE,
        resample_below=1.0,
        prior=known_prior if known else UniformPrior(),
        recovery=recovery,
    )
    return Localizer(
        here.site_map,
        here.heights,
        config,
        free_space=here.free_space if walls else here.free_space.widened(1000.0),
        backend=backend,
    )


def counts() -> list[tuple[int, int]]:
    """Return the counts that everybody gets."""
    drawn = np.random.Generator(np.random.Philox(key=SEED)).integers(0, (4, 9), (STEPS * 2, 2))
    return [(int(near), int(far)) for near, far in drawn]


def _step_s(here: Town, backend: Backend, size: int, *, whole: bool) -> float:
    recovery = _STANDING if whole else None
    localizer = _localizer(here, backend, size, recovery=recovery, walls=whole)
    state, spent = localizer.start(SEED), []
    for measured in counts()[: WARM_STEPS + STEPS]:
        started = time.thread_time()
        state, _ = localizer.step(state, DELTA, measured)
        spent.append(time.thread_time() - started)
    return median(spent[WARM_STEPS:])


def summary_table(here: Town) -> list[str]:
    """Return what it costs to say where the device is."""
    rows = [
        (
            "Saying where a device is, 8000 particles: modes with covariance, regions 50/90/95 %. "
            f"It walks {STEPS} steps of {_STRIDE_M} m and counts what is due where it is; the "
            f"median step of the best of {ROUNDS} rounds."
        ),
        "",
        "| posterior | backend | step, us | modes and regions, us | both, to the step |",
        "|---|---|---|---|---|",
    ]
    scenes: list[tuple[str, bool, Recovery | None]] = [
        ("converged, no relocation", True, None),
        ("converged, relocation", True, _STANDING),
        ("diffuse", False, _STANDING),
    ]
    east = _START[0] + _STRIDE_M * np.arange(1, STEPS + 1)
    true_places = np.column_stack([east, np.full(STEPS, _START[1])])
    walk = list(zip(*(height.at(true_places).tolist() for height in here.heights), strict=True))
    for scene, known, recovery in scenes:
        for backend in (compiled(), NUMPY):
            localizer = _localizer(here, backend, 8000, known=known, recovery=recovery)
            rounds = []
            for _ in range(ROUNDS):
                state, steps, said = localizer.start(SEED), [], []
                for due in walk:
                    started = time.thread_time()
                    state, pose = localizer.step(state, Delta(_STRIDE_M), due)
                    stepped = time.thread_time()
                    areas = [pose.region_area_m2(level) for level in (0.5, 0.9, 0.95)]
                    assert pose.modes
                    assert areas == sorted(areas)
                    steps.append(1e6 * (stepped - started))
                    said.append(1e6 * (time.thread_time() - stepped))
                rounds.append((median(steps), median(said)))
            step, say = min(rounds)
            rows.append(
                f"| {scene} | {localizer.backend.name} | {step:.0f} "
                f"| {say:.0f} | **{(step + say) / step:.1f}** |"
            )
            if recovery and known and backend is not NUMPY:
                per_core = 1.0 / (10.0 * 1e-6 * step)
    rows += ["", f"Sessions a core at 10 Hz, engine only: **{per_core:.0f}**."]
    return rows


@contextmanager
def _peers(here: Town) -> Iterator[Callable[[int], dict[str, float]]]:
    grid = here.free_space.grid
    free = here.free_space.free[:-1].reshape(grid.shape)
    near, far = (np.where(free, height.values, -100.0) for height in here.heights)
    localizer = _localizer(here, NUMPY, max(SIZES))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "town.npz")
        np.savez(
            path,
            near=near,
            far=far,
            west=grid.west_m,
            south=grid.south_m,
            cell=grid.cell_m,
            start=localizer.start(SEED).poses,
            counts=np.array(counts(), float),
            delta=np.array(DELTA[:3]),
            std=np.array(DELTA.std),
            sigma=NOISE.sigma,
        )
        command = [str(PEERS), "benchmarks/filter_peers.py", str(path)]
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as process:
            assert process.stdin
            assert process.stdout
            ask_in, ask_out = process.stdin, process.stdout

            def ask(size: int) -> dict[str, float]:
                ask_in.write(f"{size}\n")
                ask_in.flush()
                found: dict[str, float] = json.loads(ask_out.readline())
                return found

            yield ask
            ask_in.close()


if __name__ == "__main__":
    print("\n".join(table()))
