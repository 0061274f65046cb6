"""Laws of what heard landmarks tell about the blocks where each can be heard."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from homsense.audibility import Audible
from homsense.backend import NUMPY, Backend, compiled

BACKENDS = [backend for backend in (NUMPY, compiled()) if backend is not None]
BLOCKS = 5
SINGLE = st.floats(-9.0, 9.0, width=32)
ENTRY = st.tuples(st.integers(0, BLOCKS - 1), SINGLE, SINGLE, SINGLE)
HEARD = st.tuples(st.integers(0, 5), st.floats(1.0, 80.0), st.floats(-9.0, 9.0))


@pytest.mark.parametrize("backend", BACKENDS, ids=lambda backend: backend.name)
@given(st.lists(st.lists(ENTRY, max_size=6), min_size=6, max_size=6), st.lists(HEARD, max_size=8))
def test_it_is_a_sum_in_the_order_of_the_landmarks(
    backend: Backend,
    entries: list[list[tuple[int, float, float, float]]],
    heard: list[tuple[int, float, float]],
) -> None:
    flat = [entry for of_landmark in entries for entry in of_landmark]
    block, bits, expected_db, bits_per_db2 = np.array(flat, np.float64).reshape(-1, 4).T
    audible = Audible(
        np.cumsum([0, *map(len, entries)]),
        block.astype(np.int32),
        bits.astype(np.float32),
        expected_db.astype(np.float32),
        bits_per_db2.astype(np.float32),
    )
    expected = [0.0] * BLOCKS
    for landmark, height_db, above in heard:
        for at, told, loud_db, cost in entries[landmark]:
            off_db = height_db - loud_db
            expected[at] += (above + told) - cost * (off_db * off_db)
    which, loud, more = np.array(heard, np.float64).reshape(-1, 3).T
    found = backend.heard(audible, which.astype(np.int64), loud, more, BLOCKS)
    assert found.tolist() == expected
