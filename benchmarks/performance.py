"""Run all comparisons and write docs/performance.md."""

import sys
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from platform import python_version

import dense
import exactness
import filters
import growth
import mall
import neighborhoods
import quarantine

SECTIONS: Sequence[tuple[str, str, Callable[[], list[str]]]] = (
    ("neighborhoods", "Local hole counts beside GUDHI", neighborhoods.table),
    ("exactness", "Exactness", exactness.table),
    ("insertion", "Insertion as scans pour in", growth.insertion_table),
    ("sites", "Larger and larger sites", growth.site_table),
    ("density", "Memory by density", growth.density_table),
    ("dense", "Scans of 400 landmarks", dense.table),
    ("mall", "Real mall floors", mall.table),
    ("quarantine", "Transmitters that have moved", quarantine.table),
    ("filters", "The filter beside its peers", filters.table),
)
HEAD = """# Performance

`make bench` wrote this file: every figure and its peer were measured in the same run, on one
thread. CPU time, so that neighbors on the machine matter less; quote the ratios, not the
milliseconds. GUDHI-2D is GUDHI given the edges and triangles of a neighborhood for free. One
section alone, the others as they are: `python benchmarks/performance.py neighborhoods`.
"""


def main(wanted: list[str]) -> None:
    """Measure the sections that are wanted, all of them by default, and write them to the file."""
    packages = ("numpy", "numba", "gudhi")
    used = ", ".join(f"{name} {version(name)}" for name in packages)
    head = f"{HEAD}\nPython {python_version()}, {used}."
    path = Path("docs", "performance.md")
    if unknown := set(wanted) - {name for name, _, _ in SECTIONS}:
        sys.exit(f"no such section: {', '.join(sorted(unknown))}")
    kept = dict(_sections(path.read_text())) if wanted else {}
    for name, title, table in SECTIONS:
        if not wanted or name in wanted:
            kept[title] = "\n".join(table())
            print(f"## {title}\n\n{kept[title]}\n", flush=True)
    pages = [head, *(f"## {title}\n\n{kept[title]}" for _, title, _ in SECTIONS if title in kept)]
    path.write_text("\n\n".join(pages) + "\n")


def _sections(text: str) -> Iterator[tuple[str, str]]:
    for part in text.split("\n## ")[1:]:
        title, _, table = part.partition("\n")
        yield title, table.strip()


if __name__ == "__main__":
    main(sys.argv[1:])
