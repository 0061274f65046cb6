"""``homsense bench sweep``: what the paper leaves open, one quantity after the other."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.console import Console

from homsense_cli.accuracy.bench import Plan, Row, measure
from homsense_cli.accuracy.run import Control
from homsense_cli.accuracy.scenario import Scenario

COLORS: dict[Control, str] = {
    "homology": "#2f6fb7",
    "no homology": "#c9ccd1",
    "true counts": "#5b8c5a",
}


@dataclass(frozen=True, slots=True)
class Sweep:
    """One quantity that is varied while all others stay.

    Parameters
    ----------
    name : str
        Member of `Scenario`.
    title : str
        For people.
    values : tuple of float
        What it takes.
    """

    name: str
    title: str
    values: tuple[float, ...]

    def scenarios(self, seed: int) -> tuple[Scenario, ...]:
        """Return a scenario for each value."""
        return tuple(_with(Scenario(seed=seed), self.name, value) for value in self.values)


SWEEPS = (
    Sweep("transmitters", "transmitters in 0.35 km²", (60, 100, 150, 197, 300, 450)),
    Sweep("phones", "phones, 130 scans each", (2, 5, 10, 20, 40, 80)),
    Sweep("scale", "size of buildings and streets, to the usual one", (0.6, 0.8, 1.0, 1.25, 1.6)),
    Sweep("dropout", "share of transmitters that a scan misses", (0.0, 0.05, 0.15, 0.3, 0.45)),
)


def _with(scenario: Scenario, name: str, value: float) -> Scenario:
    whole = isinstance(getattr(scenario, name), int)
    changes: dict[str, Any] = {name: int(value) if whole else value}
    return replace(scenario, **changes)


def run_sweeps(
    seed: int, runs: int, out: Path, console: Console, sweeps: Sequence[Sweep] = SWEEPS
) -> Path:
    """Measure, and write ``sweeps.json`` and ``sweeps.png``.

    Parameters
    ----------
    seed : int
        Of the city.
    runs : int
        Robots for each value.
    out : pathlib.Path
        Directory of the results.
    console : rich.console.Console
        Where progress goes.
    sweeps : sequence of Sweep, optional
        What to vary.

    Returns
    -------
    pathlib.Path
        The picture.
    """
    found: dict[str, list[Row]] = {}
    for sweep in sweeps:
        console.print(sweep.title)
        plan = Plan(sweep.scenarios(seed), runs=runs, only=tuple(COLORS))
        found[sweep.name] = measure(plan, console)
    out.mkdir(parents=True, exist_ok=True)
    written = {
        "seed": seed,
        "runs": runs,
        "sweeps": [
            {
                "name": sweep.name,
                "values": sweep.values,
                "rows": [row.as_json() for row in found[sweep.name]],
            }
            for sweep in sweeps
        ],
    }
    (out / "sweeps.json").write_text(json.dumps(written, indent=1) + "\n")
    picture = out / "sweeps.png"
    _draw(sweeps, found).savefig(picture, dpi=130)
    for path in (out / "sweeps.json", picture):
        console.print(f"wrote {path}", soft_wrap=True)
    return picture


def _draw(sweeps: Sequence[Sweep], found: dict[str, list[Row]]) -> Figure:
    figure, axes = plt.subplots(
        2, len(sweeps), figsize=(3.1 * len(sweeps), 5.2), sharey="row", squeeze=False
    )
    for (upper, lower), sweep in zip(axes.T, sweeps, strict=True):
        rows = found[sweep.name]
        for control, color in COLORS.items():
            scores = [row.scores[control] for row in rows]
            _plot(upper, sweep, [100 * one.within_25_m for one in scores], color, control)
            _plot(lower, sweep, [one.final_median_m for one in scores], color, control)
        lower.set_yscale("log")
        lower.set_xlabel(sweep.title, fontsize=8)
    axes[0][0].set_ylabel("runs within 25 m, %")
    axes[1][0].set_ylabel("median error, m")
    axes[0][0].legend(frameon=False, fontsize=8)
    figure.tight_layout()
    return figure


def _plot(ax: Axes, sweep: Sweep, values: Sequence[float], color: str, label: str) -> None:
    ax.plot(sweep.values, values, marker="o", markersize=3, color=color, label=label)
    ax.tick_params(labelsize=8)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
