"""What a device says about its own motion, and what that leaves to its next step."""

from typing import NamedTuple

import homsense


class Walked(NamedTuple):
    """A pedestrian's step.

    Parameters
    ----------
    length_m : float
        Metres.
    heading_rad : float
        Radians, from any direction that stays the same.
    """

    length_m: float
    heading_rad: float


Motion = homsense.Delta | Walked | tuple[homsense.ImuSample, ...]


class OwnMotion(NamedTuple):
    """What one step leaves to the next.

    Parameters
    ----------
    velocity : homsense.Velocity
        Of the IMU.
    heading_rad : float, optional
        Of the last step walked.
    """

    velocity: homsense.Velocity = homsense.Velocity()
    heading_rad: float | None = None

    def onward(self, motion: Motion, duration_s: float) -> tuple[homsense.Delta, "OwnMotion"]:
        """Return a motion as a delta, and what it leaves."""
        if isinstance(motion, homsense.Delta):
            return motion._replace(dt_s=duration_s), self
        if isinstance(motion, Walked):
            delta = homsense.walked(motion.length_m, motion.heading_rad, self.heading_rad)
            return delta._replace(dt_s=duration_s), self._replace(heading_rad=motion.heading_rad)
        delta, velocity = homsense.preintegrate(motion, self.velocity)
        return delta, self._replace(velocity=velocity)
