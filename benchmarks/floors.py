"""Does a crowd know its floor? Recorded crowds on the maps of all recorded floors, and mirrored.

Needs the folder of recorded data. Headings are taken as unknown. Rewrites docs/accuracy/floors.md;
fails when a crowd is taken for that of another floor.
"""

import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from accuracy import OUT
from homsense_cli.accuracy.walks import Recorded, floor_crowd
from homsense_cli.recorded import floor_names

from homsense import FloorFit, rank_floors


def table(ranked: Mapping[str, Sequence[FloorFit]]) -> Iterator[str]:
    """Yield the lines of the table."""
    yield "# The crowd of each floor on the map of each"
    yield ""
    yield (
        "Cost of the best placement, probability that it is this floor of them, and what the "
        "mirror image of the crowd costs more; headings unknown. Made by `benchmarks/floors.py`."
    )
    yield ""
    yield "| crowd of | " + " | ".join(f"on {floor}" for floor in ranked) + " |"
    yield "|---" * (1 + len(ranked)) + "|"
    for name, fits in ranked.items():
        of = {fit.name: fit for fit in fits}
        cells = [
            f"{of[floor].complex.registration.cost_m:.2f} m, {of[floor].probability:.3f}, "
            f"{of[floor].complex.registration.mirror_margin_m:+.2f} m"
            for floor in ranked
        ]
        yield f"| {name} | " + " | ".join(cells) + " |"


def main() -> int:
    """Measure, write, and say what is wrong; return the exit code."""
    recorded = Recorded(Path(sys.argv[1]) / "ilc20")
    floors = {name: floor_crowd(recorded, name) for name in floor_names(recorded.directory)}
    grounds = {name: ground for name, (_, ground) in floors.items()}
    ranked = {
        name: rank_floors(crowd, grounds, hearing=recorded.hearing)
        for name, (crowd, _) in floors.items()
    }
    lines = list(table(ranked))
    (OUT / "floors.md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines[4:]))
    mistaken = [
        f"{name} is taken for {fits[0].name}"
        for name, fits in ranked.items()
        if fits[0].name != name
    ]
    print("\n".join(mistaken) or f"{len(ranked)} of {len(ranked)} crowds know their floor")
    return 1 if mistaken else 0


if __name__ == "__main__":
    sys.exit(main())
