"""The demo over seeds 1 to 10: at least 7 must end within 25 m. Prints the README's table."""

import json
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

SEEDS = range(1, 11)
WITHIN_M, AT_LEAST = 25.0, 7


def main() -> int:
    """Run the seeds two at a time; return the exit code."""
    with ThreadPoolExecutor(2) as pool:
        reports = list(pool.map(_report, SEEDS))
    print("| seed | b0, b1 | median error, last 300 m | motion and walls only |")
    print("|---|---|---|---|")
    for report in reports:
        print(
            f"| {report['seed']} | {report['b0']}, {report['b1']} "
            f"| {report['final_median_error_m']:.1f} m "
            f"| {report['baseline_no_homology_m']:.1f} m |"
        )
    good = sum(report["final_median_error_m"] < WITHIN_M for report in reports)
    blind = sum(report["baseline_no_homology_m"] < WITHIN_M for report in reports)
    print(f"\nwithin {WITHIN_M:.0f} m: {good} of {len(reports)}; without homology: {blind}")
    return 0 if good >= AT_LEAST else 1


def _report(seed: int) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as out:
        command = ["-m", "homsense_cli", "demo", "--seed", str(seed), "--out", out]
        subprocess.run([sys.executable, *command], check=True, stdout=subprocess.DEVNULL)
        found: dict[str, Any] = json.loads((Path(out) / "report.json").read_text())
        return found


if __name__ == "__main__":
    sys.exit(main())
