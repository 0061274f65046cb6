"""Laws of what resembled scans tell about the blocks near them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from homsense.backend import NUMPY, Backend, compiled
from homsense.resemblance import Nearby

BACKENDS = [backend for backend in (NUMPY, compiled()) if backend is not None]
BLOCKS, RINGS, LEVELS = 5, 3, 4
ENTRY = st.tuples(
    st.integers(0, BLOCKS - 1), st.floats(0.001, 1.0), st.integers(0, RINGS - 1)
)  # block, kernel, ring
GAINS = st.lists(st.floats(-9.0, 9.0), min_size=RINGS * LEVELS, max_size=RINGS * LEVELS)


@pytest.mark.parametrize("backend", BACKENDS, ids=lambda backend: backend.name)
@given(st.lists(st.lists(ENTRY, max_size=6), min_size=1, max_size=6), GAINS, st.data())
def test_it_is_a_sum_in_the_order_of_the_scans(
    backend: Backend,
    entries: list[list[tuple[int, float, int]]],
    gains: list[float],
    data: st.DataObject,
) -> None:
    scans = data.draw(st.lists(st.integers(0, len(entries) - 1), max_size=8))
    levels = data.draw(
        st.lists(st.integers(0, LEVELS - 1), min_size=len(scans), max_size=len(scans))
    )
    flat = [entry for of_scan in entries for entry in of_scan]
    nearby = Nearby(
        np.cumsum([0, *map(len, entries)]),
        np.array([block for block, _, _ in flat], np.intp),
        np.array([kernel for _, kernel, _ in flat], np.float64),
        np.array([LEVELS * ring for _, _, ring in flat], np.int32),
        np.array(gains),
    )
    expected = [0.0] * BLOCKS
    for scan, level in zip(scans, levels, strict=True):
        for block, kernel, ring in entries[scan]:
            expected[block] += gains[LEVELS * ring + level] * kernel
    told = backend.told(nearby, np.array(scans, np.int64), np.array(levels, np.int32), BLOCKS)
    assert told.tolist() == expected
