"""The collector of cyclic garbage: told what stays, and given little to do.

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


def let_go(error: BaseException | None) -> None:
    """Take the frames from an error and from those before it; they hold whatever was at work.

    An error that is kept keeps all of that in memory, and one that a frame holds in its turn does
    so until the collector comes by.
    """
    while error is not None:
        error.__traceback__ = None
        error = error.__cause__ or error.__context__
