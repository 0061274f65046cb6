"""The accuracy that is promised: many robots, each beside its controls. Rewrites docs/accuracy/.

Five generated downtowns, two of them with the registered crowd as well, other styles of cities,
and the centre of Helsinki and recorded mall floors where the folder of recorded data is given;
names after it measure some alone. Fails when a promise about downtowns or Helsinki is not kept.
"""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

from homsense_cli.accuracy.bench import HEADINGS, Plan, Row, lines, measure
from homsense_cli.accuracy.run import Control
from homsense_cli.accuracy.scenario import Scenario
from homsense_cli.accuracy.walks import Recorded
from rich.console import Console

OUT = Path(__file__).parents[1] / "docs" / "accuracy"
SEEDS, RUNS = range(5), 32
COVERAGE = 0.85, 0.97
WITHIN = {"moderate": 0.95, "heavy": 0.75}
MEDIAN_M, HELSINKI_WITHIN = 12.0, 0.85
COUNTING: tuple[Control, ...] = ("homology", "no homology", "shuffled", "true counts")


def plans(data: Path | None) -> dict[str, Plan]:
    """Return what to measure, by the name of its file."""
    towns = tuple(Scenario(seed=seed) for seed in SEEDS)
    found = {"downtown": Plan(towns, ("moderate", "heavy", "paper"), runs=RUNS, only=COUNTING)}
    found["crowd"] = Plan(towns[:2], ("moderate", "heavy"), runs=8)
    others = tuple(Scenario(city, seed=seed) for city in ("old-town", "campus") for seed in (0, 1))
    found["styles"] = Plan(others, ("moderate",), runs=RUNS, only=COUNTING)
    if data is not None:
        footprints = str(data / "helsinki_centre" / "local.json.gz")
        centre = tuple(
            Scenario(footprints, seed, 400, 60.0, window_m=600.0) for seed in range(1, 4)
        )
        found["helsinki"] = Plan(centre, ("moderate", "heavy"), runs=RUNS)
        found["mall"] = Plan(recorded=Recorded(data / "ilc20"), runs=3)
    return found


def broken(name: str, row: Row) -> Iterator[str]:
    """Yield the promises that a row does not keep."""
    ours = row.scores["homology"]
    if name == "downtown" and row.motion in WITHIN:
        share = ours.within_25_m if row.motion == "moderate" else ours.within_50_m
        if share < WITHIN[row.motion]:
            yield f"{row.world}, {row.motion}: {share:.0%} are near enough"
        if row.motion == "moderate" and ours.final_median_m > MEDIAN_M:
            yield f"{row.world}: median {ours.final_median_m:.1f} m"
    if name == "helsinki" and row.motion == "moderate" and ours.within_25_m < HELSINKI_WITHIN:
        yield f"{row.world}: {ours.within_25_m:.0%} within 25 m"
    promised = (name == "downtown" and row.motion in WITHIN) or name == "helsinki"
    if promised and not COVERAGE[0] <= ours.coverage_90 <= COVERAGE[1]:
        yield f"{row.world}, {row.motion}: truth in the 90 % region in {ours.coverage_90:.1%}"


def markdown(rows: list[Row]) -> Iterator[str]:
    """Yield a table in Markdown."""
    yield "| " + " | ".join(HEADINGS) + " |"
    yield "|" + "---|" * len(HEADINGS)
    for row in rows:
        for line in lines(row):
            yield "| " + " | ".join(line) + " |"


def main() -> int:
    """Measure, write, and say what is broken; return the exit code."""
    data = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    wanted = sys.argv[2:]
    OUT.mkdir(exist_ok=True)
    failures: list[str] = []
    for name, plan in plans(data).items():
        if wanted and name not in wanted:
            continue
        rows = measure(plan, Console(stderr=True))
        (OUT / f"{name}.md").write_text("\n".join(markdown(rows)) + "\n")
        written = json.dumps([row.as_json() for row in rows], indent=1)
        (OUT / f"{name}.json").write_text(written + "\n")
        failures += [reason for row in rows for reason in broken(name, row)]
    print("\n".join(failures) or "every promise is kept")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
