"""The collector of cyclic garbage, told what stays.

A full collection looks at every object there is. Modules and what numba has compiled are some
300 000 that never go; looked at again and again while scans pour in, they are a third of the time.
"""

import gc

YOUNG = 50_000
"""Objects that are made before the collector looks at the young ones; Python's own figure is 700,
which a few scans reach."""


def settle() -> None:
    """Leave alone from now on whatever is there, and look at the rest less often."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(YOUNG, *gc.get_threshold()[1:])
