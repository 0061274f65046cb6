"""Whether a device is there: by its token, and by what it sends."""

from typing import Literal

State = Literal["online", "offline", "gone"]
DEBOUNCE_S = 0.5


class Presence:
    """The signs of life of one device.

    Parameters
    ----------
    now_s : float
        Seconds, as everywhere here.
    silence_s : float
        A device that sends nothing for so long is offline.
    grace_s : float
        One that is offline for so long is gone.

    Examples
    --------
    >>> presence = Presence(0.0, silence_s=5.0, grace_s=60.0)
    >>> presence.state(4.0), presence.state(6.0), presence.state(66.0)
    ('online', 'offline', 'gone')
    """

    def __init__(self, now_s: float, silence_s: float, grace_s: float) -> None:
        self._heard_s, self._vanished_s = now_s, float("inf")
        self._silence_s, self._grace_s = silence_s, grace_s

    def heard(self, now_s: float) -> None:
        """Take note of a message; what was on its way when its token ended tells nothing new."""
        self._heard_s = now_s
        if now_s >= self._vanished_s + DEBOUNCE_S:
            self._vanished_s = float("inf")

    def appeared(self, now_s: float) -> None:
        """Take note of its token; a device that reconnects comes back at once."""
        self._heard_s, self._vanished_s = now_s, float("inf")

    def vanished(self, now_s: float) -> None:
        """Take note of the end of its token."""
        self._vanished_s = now_s

    def state(self, now_s: float) -> State:
        """Return what it is now."""
        since_s = min(self._heard_s + self._silence_s, self._vanished_s + DEBOUNCE_S)
        if now_s < since_s:
            return "online"
        return "offline" if now_s < since_s + self._grace_s else "gone"
