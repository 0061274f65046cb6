"""The registered complex on recorded walks, each beside its controls. Rewrites docs/accuracy/.

Walks of 150 m and more, each left out of the crowd; needs the folder of recorded data. Fails when
a promise is not kept.
"""

import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from accuracy import OUT, markdown
from homsense_cli.accuracy.bench import Plan, Row, measure
from homsense_cli.accuracy.run import Control
from homsense_cli.accuracy.walks import Recorded
from rich.console import Console

SEEDS = 3
ONLY: tuple[Control, ...] = ("no homology", "registered", "elsewhere")
MOST_M = {"all": 5.0, "binary": 8.0, "no compass": 9.0, "half the crowd": 10.0}
WITHIN_15, BEAT_WALLS, WALKS = 20, 22, 24
COVERAGE = 0.85, 0.97
HOLES_M, TOLD_UNMAPPED = 11.0, 0.8


def plans(data: Path) -> dict[str, Plan]:
    """Return what to measure, by name."""
    walks = Recorded(data / "ilc20")
    some = Plan(recorded=walks, runs=SEEDS, only=ONLY)
    return {
        "all": replace(
            some, only=(*ONLY, "both", "holes at place", "homology", "shuffled", "true counts")
        ),
        "binary": replace(some, recorded=replace(walks, binary=True)),
        "no compass": replace(some, recorded=replace(walks, compass=False)),
        "half the crowd": replace(some, recorded=replace(walks, crowd=0.5)),
    }


def broken(name: str, row: Row) -> Iterator[str]:
    """Yield the promises that the row of all floors does not keep."""
    ours, inside = row.walks["registered"], row.scores["registered"].coverage_90
    if ours.median_m > MOST_M[name]:
        yield f"{name}: {ours.median_m:.1f} m"
    if name != "all":
        return
    if ours.last_within_15_m < WITHIN_15:
        yield f"{ours.last_within_15_m} walks end within 15 m"
    if ours.beats["no homology"] < BEAT_WALLS:
        yield f"{ours.beats['no homology']} walks are better than with walls alone"
    if ours.beats["elsewhere"] < WALKS:
        yield f"{ours.beats['elsewhere']} walks are better than with scans of other places"
    if not COVERAGE[0] <= inside <= COVERAGE[1]:
        yield f"truth in the 90 % region in {inside:.1%}"
    holes = row.walks["holes at place"].median_m
    if holes > HOLES_M:
        yield f"hole counts at the registered place: {holes:.1f} m"
    told = row.scores["registered"].told_unmapped
    if told is not None and told < TOLD_UNMAPPED:
        yield f"unmapped is told in {told:.0%} of the steps where nobody has been"


def main() -> int:
    """Measure, write, and say what is broken; return the exit code."""
    failures: list[str] = []
    text: list[str] = []
    written: dict[str, list[object]] = {}
    for name, plan in plans(Path(sys.argv[1])).items():
        if sys.argv[2:] and name not in sys.argv[2:]:
            continue
        rows = measure(plan, Console(stderr=True))
        text += [f"## {name}", "", *markdown(rows), ""]
        written[name] = [row.as_json() for row in rows]
        failures += broken(name, rows[-1])
    (OUT / "registered.md").write_text("\n".join(text))
    (OUT / "registered.json").write_text(json.dumps(written, indent=1) + "\n")
    print("\n".join(failures) or "every promise is kept")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
