"""The earth mover's distance is what scipy says it is."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import wasserstein_distance

from homsense.earth_mover import earth_mover_distance

SAMPLE = st.lists(
    st.one_of(st.integers(0, 20), st.floats(-1e6, 1e6, allow_nan=False)), min_size=1, max_size=30
)


@given(SAMPLE, SAMPLE)
def test_it_equals_that_of_scipy(one: list[float], other: list[float]) -> None:
    found = earth_mover_distance(one, other)
    assert np.isclose(found, wasserstein_distance(one, other), rtol=1e-12, atol=1e-9)
    assert found == earth_mover_distance(other, one) >= 0.0
    assert earth_mover_distance(one, one[::-1]) == 0.0
