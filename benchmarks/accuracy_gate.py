"""Write the reference that the accuracy gate of `make test` compares with.

A few robots in one town; the gate runs the first of them again and fails when they do worse by
more than the quartiles of the runs lie apart. Run this only when accuracy has changed on purpose.
"""

import json
import sys
from pathlib import Path

import numpy as np
from homsense_cli.accuracy.run import Filter, run_city
from homsense_cli.accuracy.scenario import IMUS, Scenario
from homsense_cli.accuracy.scene import prepare
from homsense_cli.accuracy.score import final_medians

RUNS, LENGTH_M = 24, 900.0
SCENARIO = Scenario(seed=21, phones=30)
REFERENCE = Path(__file__).parents[1] / "tests" / "integration" / "accuracy_gate.json"


def finals(runs: int) -> dict[str, list[float]]:
    """Return the final median error of some runs, with and without homology, metres."""
    city = prepare(SCENARIO, tracked=False)
    found = [
        run_city(
            city, IMUS["moderate"], run, LENGTH_M, Filter(4000, only=("homology", "no homology"))
        )
        for run in range(runs)
    ]
    return {
        control: final_medians([tracks[control] for tracks in found]).round(3).tolist()
        for control in ("homology", "no homology")
    }


def main() -> int:
    """Write the reference; return the exit code."""
    found = finals(RUNS)
    lower, upper = np.percentile(found["homology"], [25, 75])
    spread = float(upper - lower)
    reference = {"runs": RUNS, "length_m": LENGTH_M, "spread_m": round(spread, 3), **found}
    REFERENCE.write_text(json.dumps(reference, indent=1) + "\n")
    print(f"wrote {REFERENCE.name}: spread {spread:.1f} m, {found['homology']}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
