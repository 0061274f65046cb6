"""Inputs for the laws; every range is named once."""

from hypothesis import strategies as st

LANDMARKS = st.sampled_from([f"l{number:02d}" for number in range(24)])
OBSERVATION = st.frozensets(LANDMARKS, max_size=7)
OBSERVATIONS = st.lists(OBSERVATION, max_size=24)
SMALL_OBSERVATIONS = st.lists(st.frozensets(LANDMARKS, max_size=5), max_size=10)
HOPS = st.lists(st.integers(0, 5), min_size=1, max_size=4)
FINITE = st.floats(-1e3, 1e3)
