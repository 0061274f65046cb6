"""One step of `particles` and of `pfilter` on a town; runs where these two are installed.

Both get the same map, inputs and look-up likelihood as ours, and resample systematically at every
step. Reads the town from the file that is named, writes CPU seconds a step to standard output.
"""

import json
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import particles
from numpy.typing import NDArray
from pfilter import ParticleFilter, systematic_resample

Array = NDArray[Any]
Town = dict[str, Array]
RNG = np.random.Generator(np.random.Philox(key=1))
WARM_STEPS, STEPS = 5, 25


def moved(town: Town, poses: Array) -> Array:
    """Return poses moved by the town's motion with its noise."""
    noise = RNG.standard_normal(poses.shape) * town["std"]
    forward, left, turn = (town["delta"] + noise).T
    cosine, sine = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    return np.stack(
        [
            poses[:, 0] + cosine * forward - sine * left,
            poses[:, 1] + sine * forward + cosine * left,
            np.remainder(poses[:, 2] + turn + np.pi, 2 * np.pi) - np.pi,
        ],
        axis=1,
    )


def expected(town: Town, poses: Array) -> Array:
    """Return the counts that poses expect, near and far; a blocked cell expects -100."""
    column = np.floor((poses[:, 0] - town["west"]) / town["cell"]).astype(int)
    row = np.floor((poses[:, 1] - town["south"]) / town["cell"]).astype(int)
    rows, columns = town["near"].shape
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    at = np.where(inside, row, 0), np.where(inside, column, 0)
    return np.stack([np.where(inside, town[level][at], -100.0) for level in ("near", "far")], 1)


def log_likelihood(town: Town, counts: Array, measured: Array) -> Array:
    """Return the sum of the logarithms of two floored Gaussians."""
    apart = (counts - measured) / town["sigma"]
    total: Array = np.log(0.02 + 0.98 * np.exp(-0.5 * apart**2)).sum(axis=1)
    return total


class Walk(particles.FeynmanKac):  # type: ignore[misc]
    """The town as `particles` wants it."""

    def __init__(self, town: Town) -> None:
        super().__init__(WARM_STEPS + STEPS + 1)
        self.town = town

    def M0(self, N: int) -> Array:  # noqa: N802, N803 - their names
        """Draw the start."""
        return self.town["start"][:N].copy()

    def M(self, t: int, xp: Array) -> Array:  # noqa: ARG002, N802
        """Draw a motion."""
        return moved(self.town, xp)

    def logG(self, t: int, xp: Array, x: Array) -> Array:  # noqa: ARG002, N802
        """Weigh."""
        return log_likelihood(self.town, expected(self.town, x), self.town["counts"][t])


def smc(town: Town, count: int) -> float:
    """Return the CPU seconds of a step of `particles`."""
    run = particles.SMC(Walk(town), N=count, resampling="systematic", ESSrmin=1.0)
    return median_of(lambda: next(run))


def bootstrap(town: Town, count: int) -> float:
    """Return the CPU seconds of a step of `pfilter` with its systematic resampler."""
    run = ParticleFilter(
        prior_fn=lambda n: town["start"][:n].copy(),
        observe_fn=lambda poses: expected(town, poses),
        n_particles=count,
        dynamics_fn=lambda poses: moved(town, poses),
        noise_fn=lambda poses: poses,
        weight_fn=lambda found, measured: np.exp(log_likelihood(town, found, measured)),
        resample_fn=systematic_resample,
    )
    measured = iter(town["counts"])
    return median_of(lambda: run.update(next(measured)))


def median_of(step: Callable[[], object]) -> float:
    """Return the median CPU seconds of the steps after the first ones."""
    spent = []
    for _ in range(WARM_STEPS + STEPS):
        started = time.thread_time()
        step()
        spent.append(time.thread_time() - started)
    return float(np.median(spent[WARM_STEPS:]))


def main(path: str) -> None:
    """Answer each line of standard input, a number of particles, with two durations."""
    town = dict(np.load(path))
    for line in sys.stdin:
        count = int(line)
        found = {"particles": smc(town, count), "pfilter": bootstrap(town, count)}
        print(json.dumps(found), flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
