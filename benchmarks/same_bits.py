"""Digests of one session at three CPU feature levels, with numpy and with numba.

numpy is kept from its vector code by ``NPY_DISABLE_CPU_FEATURES``, numba by ``NUMBA_CPU_NAME``;
each level runs in a process of its own. All digests have to be equal. The sessions change the
backend halfway, each way, too.
"""

import json
import os
import subprocess
import sys
import tempfile

import numpy as np

from homsense import Delta, FreeSpace, HeightMap, Localizer, LocalizerConfig, SiteMap
from homsense.backend import NUMPY, compiled

STEPS = 60
LEVELS = {
    "all that the processor has": ("", ""),
    "AVX2": ("V4 AVX512", "x86-64-v3"),
    "SSE2": ("V4 AVX512 V3 AVX2 FMA3 SSE4", "x86-64"),
}


def session() -> dict[str, str]:
    """Return the digests of a session after its last step, by backend."""
    ring = [[0, 0], [40, 0], [40, 30], [0, 30], [0, 0]]
    blocks = [
        {"type": "Polygon", "coordinates": [[[x + 90 * i, y + 80 * j] for x, y in ring]]}
        for i in range(3)
        for j in range(3)
    ]
    features = [{"type": "Feature", "geometry": block, "properties": {}} for block in blocks]
    site_map = SiteMap.from_geojson(
        {"type": "FeatureCollection", "frame": "local", "features": features}
    )
    heights = [HeightMap.geometric(site_map, radius, cell_m=2.0) for radius in (80.0, 120.0)]
    numpy_run = Localizer(
        site_map,
        heights,
        LocalizerConfig(particles=3000),
        free_space=FreeSpace.of(site_map, 2.0),
        backend=NUMPY,
    )
    numba_run = numpy_run.run_by(compiled() or NUMPY)
    plans = {
        "numpy": [numpy_run] * STEPS,
        "numba": [numba_run] * STEPS,
        "numpy, then numba": [numpy_run] * (STEPS // 2) + [numba_run] * (STEPS // 2),
        "numba, then numpy": [numba_run] * (STEPS // 2) + [numpy_run] * (STEPS // 2),
    }
    return {name: _digest(plan) for name, plan in plans.items()}


def _digest(plan: list[Localizer]) -> str:
    state = plan[0].start(20260101)
    for tick, localizer in enumerate(plan):
        delta = Delta(3.0, 0.1, 0.3 if tick % 7 == 0 else 0.01)
        state, _ = localizer.step(state, delta, (tick % 3, 1 + tick % 4))
    return state.digest()


def _run(numpy_without: str, numba_as: str) -> dict[str, str]:
    known = [name for name in _dispatched() if any(part in name for part in numpy_without.split())]
    with tempfile.TemporaryDirectory() as cache:
        environment = os.environ | {"NUMBA_CACHE_DIR": cache}
        if known:
            environment["NPY_DISABLE_CPU_FEATURES"] = " ".join(known)
        if numba_as:
            environment |= {"NUMBA_CPU_NAME": numba_as, "NUMBA_CPU_FEATURES": ""}
        answer = subprocess.run(
            [sys.executable, __file__, "--session"],
            env=environment,
            check=True,
            capture_output=True,
        )
    found: dict[str, str] = json.loads(answer.stdout)
    return found


def _dispatched() -> list[str]:
    features: list[str] = np._core._multiarray_umath.__cpu_dispatch__  # type: ignore[attr-defined]  # noqa: SLF001
    return features


def main() -> int:
    """Print the digests; return the exit code."""
    if "--session" in sys.argv:
        print(json.dumps(session()))
        return 0
    digests = set()
    print("| level | " + " | ".join(session()) + " |\n|---|---|---|---|---|")
    for level, (numpy_without, numba_as) in LEVELS.items():
        found = _run(numpy_without, numba_as)
        digests |= set(found.values())
        print(f"| {level} | " + " | ".join(found.values()) + " |")
    print(f"\ndifferent digests: {len(digests)} (must be 1)")
    return 0 if len(digests) == 1 else 1


if __name__ == "__main__":
    sys.exit(main())
