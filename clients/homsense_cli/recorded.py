"""Recorded real data -> maps, scans and walks, in the words of the contract.

Reads folders of mall floors with surveyed walks, as ``docs/data.md`` describes them. Truth is read
for scoring only and never leaves this package.
"""

import gzip
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from homsense_cli.maps import collection, feature, read_json

FloatArray = NDArray[np.float64]

MIN_CHAIN_M = 150.0
REPORTED_DBM = -80
SCAN_LASTS_S = 1.0
HEADING_STD_RAD = 0.2
STEP_STD = 0.2, 0.2, 0.03
WALL_TOLERANCE_M = 1.0


@dataclass(frozen=True, slots=True)
class Trace:
    """One recorded walk of a phone.

    Parameters
    ----------
    id : str
        Name of the recording.
    t0_s : float
        Start, Unix seconds.
    truth : ndarray, shape (W, 3), float64
        Seconds since the start, x and y in metres, where a surveyor stood.
    scans : list
        (seconds since the start, readings) pairs; readings are ``id``, ``rssi`` and ``age_s``. A
        scan lasts for two seconds and is reported at its end; the time is that of its middle.
    steps : ndarray, shape (S, 3), float64
        Seconds since the start, heading in radians and length in metres of detected steps.
    """

    id: str
    t0_s: float
    truth: FloatArray
    scans: list[tuple[float, list[dict[str, Any]]]]
    steps: FloatArray

    def position(self, t_s: float) -> tuple[float, float]:
        """Return the true position, linear between the surveyor's places."""
        seconds, x, y = self.truth.T
        return float(np.interp(t_s, seconds, x)), float(np.interp(t_s, seconds, y))

    def reckoned(self, t_s: float) -> tuple[float, float]:
        """Return where the phone believes to be, by its own steps from where it began."""
        if not len(self.steps):
            return 0.0, 0.0
        seconds, heading, length = self.steps.T
        x, y = np.cumsum(length * np.cos(heading)), np.cumsum(length * np.sin(heading))
        east, north = (float(np.interp(t_s, seconds, axis, left=0.0)) for axis in (x, y))
        return east, north


@dataclass(frozen=True, slots=True)
class Floor:
    """A mall floor: its map, its recordings, and which of them join into long walks."""

    name: str
    map_document: dict[str, Any]
    traces: dict[str, Trace]
    chains: list[list[str]]


@dataclass(frozen=True, slots=True)
class WalkEvent:
    """Something that happens on a walk, in order of time.

    Parameters
    ----------
    t_s : float
        Unix seconds.
    delta : dict, optional
        Body-frame motion of a detected step.
    readings : list of dict, optional
        A scan.
    truth : tuple of float
        True position, metres; for scoring only.
    """

    t_s: float
    delta: dict[str, Any] | None
    readings: list[dict[str, Any]] | None
    truth: tuple[float, float]


def floor_names(directory: Path) -> list[str]:
    """Return the floors that a folder holds."""
    return sorted(path.name.split(".")[0] for path in (directory / "traces").glob("*.jsonl.gz"))


def chosen_floors(directory: Path, floors: Sequence[str]) -> tuple[str, ...]:
    """Return some floors, all when none is named; raise ValueError when there is none."""
    found = tuple(floors) or tuple(floor_names(directory))
    if not found:
        message = f"{directory} holds no recordings"
        raise ValueError(message)
    return found


def no_walk(where: object, min_chain_m: float = MIN_CHAIN_M) -> str:
    """Say what a folder or a floor lacks."""
    return f"{where} holds no walk of {min_chain_m:.0f} m or more"


def read_floor(directory: Path, name: str, min_chain_m: float = MIN_CHAIN_M) -> Floor:
    """Read a floor.

    Parameters
    ----------
    directory : pathlib.Path
        Folder with ``traces``, ``maps``, ``bssid.json.gz`` and ``chains.json``.
    name : str
        Such as ``site1_F2``.
    min_chain_m : float, default 150.0
        Shortest walk that is of interest, metres.

    Returns
    -------
    Floor
        Metres, x east, y north.

    Raises
    ------
    ValueError
        If the floor is not in ``chains.json``, or a recording that a walk consists of is missing.
    """
    bssid = read_json(directory / "bssid.json.gz")
    with gzip.open(directory / "traces" / f"{name}.jsonl.gz", "rt") as lines:
        traces = [_trace(json.loads(line), bssid) for line in lines]
    return Floor(
        name,
        _floor_map(read_json(directory / "maps" / f"{name}.local.json.gz")),
        {trace.id: trace for trace in traces},
        _chains(directory / "chains.json", name, min_chain_m, {trace.id for trace in traces}),
    )


def _chains(path: Path, floor: str, min_chain_m: float, known: set[str]) -> list[list[str]]:
    of_floor = read_json(path).get(floor)
    if of_floor is None:
        message = f"{path} does not name the floor {floor!r}"
        raise ValueError(message)
    long = [chain["traces"] for chain in of_floor["chains"] if chain["length_m"] >= min_chain_m]
    unknown = {name for chain in long for name in chain} - known
    if unknown:
        message = f"{path} names {min(unknown)!r}, of which {floor} has no recording"
        raise ValueError(message)
    return long


def crowd_scans(floor: Floor, without: list[str]) -> Iterator[dict[str, Any]]:
    """Yield the scans of all other phones as the service takes them, without any position."""
    for trace in floor.traces.values():
        if trace.id in without:
            continue
        for number, (t_s, readings) in enumerate(trace.scans):
            if readings:
                x, y = trace.reckoned(t_s)
                yield {
                    "device": trace.id,
                    "scan_id": str(number),
                    "observed_at": trace.t0_s + t_s,
                    "landmarks": readings,
                    "track": {"id": "walk", "x_m": x, "y_m": y},
                }


def walk_events(floor: Floor, chain: list[str]) -> list[WalkEvent]:
    """Return the steps and scans of a walk in order of time.

    The first step gives the start heading and no turn; the walk goes on where a recording ends.
    """
    events: list[WalkEvent] = []
    heading = start_heading(floor, chain)
    for name in chain:
        trace = floor.traces[name]
        moments: list[tuple[float, int, list[dict[str, Any]] | None]]
        moments = [(float(t), index, None) for index, t in enumerate(trace.steps[:, 0])]
        moments += [(t, -1, readings) for t, readings in trace.scans if readings]
        for t, index, readings in sorted(moments, key=lambda moment: moment[0]):
            delta = None
            if readings is None:
                _, towards, length = trace.steps[index]
                turn = math.remainder(float(towards) - heading, math.tau)
                heading = float(towards)
                delta = {"turn_rad": turn, "length_m": float(length)}
            events.append(WalkEvent(trace.t0_s + t, delta, readings, trace.position(t)))
    return events


def body_motion(step: dict[str, Any]) -> tuple[float, float, float]:
    """Return forward m, left m and turn rad of a detected step: it turns, then goes straight."""
    turn, length = step["turn_rad"], step["length_m"]
    return length * math.cos(turn), length * math.sin(turn), turn


def start_heading(floor: Floor, chain: list[str]) -> float:
    """Return the compass heading of the first step, radians."""
    return float(np.concatenate([floor.traces[name].steps for name in chain])[0, 1])


def _trace(line: dict[str, Any], bssid: list[str]) -> Trace:
    scans = [
        (
            dt / 1000.0 - SCAN_LASTS_S,
            [
                {"id": bssid[index], "rssi": float(rssi), "age_s": max(0.0, age / 1000.0)}
                for index, rssi, _frequency, age in entries
                if rssi >= REPORTED_DBM
            ],
        )
        for dt, entries in line["scans"]
    ]
    return Trace(
        line["id"],
        line["t0"] / 1000.0,
        np.array(line["wp"], dtype=np.float64) * (1e-3, 1.0, 1.0),
        scans,
        np.array(line["steps"], dtype=np.float64).reshape(-1, 3) * (1e-3, 1.0, 1.0),
    )


def _floor_map(local: dict[str, Any]) -> dict[str, Any]:
    walkable = [feature(polygon, role="domain") for polygon in local["walkable"]]
    structures = [feature({"ext": ring, "holes": []}) for ring in local["structures"]]
    return collection([*walkable, *structures])
