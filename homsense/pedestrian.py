"""From a pedestrian's steps to motions."""

import math

from homsense.errors import InvalidInputError
from homsense.pose import MAX_DELTA, Delta
from homsense.scalar import TURN, cosine, sine

LENGTH_SHARE, HEADING_RAD = 0.1, 0.1
MAX_STEP_M = 100.0


def walked(length_m: float, heading_rad: float, before_rad: float | None) -> Delta:
    """Return the motion of a step: a turn to its heading, then straight on.

    Parameters
    ----------
    length_m : float
        In [0, 100], metres.
    heading_rad : float
        Of the step, radians counter-clockwise from any direction that stays the same; a compass
        that knows east is worth a heading in the session's prior.
    before_rad : float or None
        Heading of the step before; none for the first, which is taken as straight on.

    Returns
    -------
    Delta
        With deviations of a tenth of the length and of 0.1 rad.

    Raises
    ------
    InvalidInputError
        If the length or a heading is out of range.

    Examples
    --------
    >>> delta = walked(0.7, math.pi / 2, before_rad=0.0)
    >>> round(abs(delta.forward_m), 6), round(delta.left_m, 6), round(delta.turn_rad, 6)
    (0.0, 0.7, 1.570796)
    """
    from_rad = heading_rad if before_rad is None else before_rad
    is_turn = abs(heading_rad) <= MAX_DELTA and abs(from_rad) <= MAX_DELTA
    if not (0.0 <= length_m <= MAX_STEP_M and is_turn):
        message = (
            f"a step has a length in [0, {MAX_STEP_M:.0f}] m and headings of at most "
            f"{MAX_DELTA:.0f} rad"
        )
        raise InvalidInputError(message, "step")
    turns = (heading_rad - from_rad) / TURN
    turns -= math.floor(turns + 0.5)
    error_m = LENGTH_SHARE * length_m
    return Delta(
        length_m * cosine(turns),
        length_m * sine(turns),
        turns * TURN,
        std=(error_m, error_m, HEADING_RAD),
    )
