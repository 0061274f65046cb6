"""Folders of recorded walks as docs/data.md describes them, made up in a small building."""

import gzip
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from support.corridors import PACE_M, Building

FloatArray = NDArray[np.float64]

SCAN_EVERY = 2
PACE_MS = 2000


def write_floors(folder: Path, building: Building, floors: dict[str, tuple[float, int]]) -> None:
    """Write floors of the same corridors: one walk of a length in metres, and so many others.

    The walk is two recordings.
    """
    for name in ("traces", "maps"):
        (folder / name).mkdir()
    names = [f"tx-{number:02d}" for number in range(len(building.transmitters))]
    _pack(folder / "bssid.json.gz", [json.dumps(names)])
    chains = {}
    for floor, (length_m, others) in floors.items():
        rng = np.random.default_rng(1)
        walks = np.array_split(building.walk(rng, length_m), 2)
        walks += [building.walk(rng) for _ in range(others)]
        ids = [f"{floor}-{number}" for number in range(len(walks))]
        traces = [_trace(*walk, building, rng) for walk in zip(ids, walks, strict=True)]
        chains[floor] = {"chains": [{"length_m": length_m, "traces": ids[:2]}]}
        _pack(folder / "traces" / f"{floor}.jsonl.gz", map(json.dumps, traces))
        _pack(folder / "maps" / f"{floor}.local.json.gz", [json.dumps(_local(building))])
    (folder / "chains.json").write_text(json.dumps(chains))


def _trace(
    name: str, places: FloatArray, building: Building, rng: np.random.Generator
) -> dict[str, Any]:
    moments = PACE_MS * np.arange(len(places))
    east, north = np.diff(places, axis=0).T
    heading = np.arctan2(north, east) + rng.normal(0.0, 0.05, len(east))
    return {
        "id": name,
        "t0": 1_000_000,
        "wp": np.column_stack([moments, places]).tolist(),
        "scans": [
            (int(moments[at]), [
                (int(reading.landmark[3:]), reading.rssi_dbm, 2400, 0)
                for reading in building.readings(places[at], rng)
            ])
            for at in range(0, len(places), SCAN_EVERY)
        ],
        "steps": [
            (int(moment), towards, PACE_M)
            for moment, towards in zip(moments[1:], heading.tolist(), strict=True)
        ],
    }  # fmt: skip


def _local(building: Building) -> dict[str, Any]:
    return {
        "walkable": [
            {"ext": [*part.exterior.coords], "holes": [[*hole.coords] for hole in part.interiors]}
            for part in building.site_map.domain.geoms
        ],
        "structures": [[*one.exterior.coords] for one in building.site_map.structures],
    }


def _pack(path: Path, lines: Iterable[str]) -> None:
    with gzip.open(path, "wt") as packed:
        packed.writelines(f"{line}\n" for line in lines)
