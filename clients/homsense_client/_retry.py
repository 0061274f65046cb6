"""When to try again and how long to wait before. Pure."""

from collections.abc import Mapping
from dataclasses import dataclass

_TOO_MANY = 429
_SERVER = 500


@dataclass(frozen=True, slots=True)
class Retry:
    """A policy of retries with exponential back-off.

    Parameters
    ----------
    attempts : int, default 5
        How often to try in all.
    first_s : float, default 0.2
        Wait before the second attempt, seconds; doubled each time.
    longest_s : float, default 10.0
        Longest wait, seconds.
    """

    attempts: int = 5
    first_s: float = 0.2
    longest_s: float = 10.0

    def wait_s(self, failed: int, headers: Mapping[str, str] | None = None) -> float | None:
        """Return how long to wait after some failed attempts, None to give up.

        Parameters
        ----------
        failed : int
            Attempts so far, at least 1.
        headers : mapping, optional
            Of the answer; ``Retry-After`` in seconds is obeyed.

        Returns
        -------
        float or None
            Seconds.

        Examples
        --------
        >>> [Retry(attempts=4).wait_s(failed) for failed in (1, 2, 3, 4)]
        [0.2, 0.4, 0.8, None]
        """
        if failed >= self.attempts:
            return None
        asked = (headers or {}).get("retry-after", "")
        if asked.isdigit():
            return min(float(asked), self.longest_s)
        return float(min(self.first_s * 2 ** (failed - 1), self.longest_s))


def is_transient(status: int) -> bool:
    """Tell whether the same request may be answered better later."""
    return status == _TOO_MANY or status >= _SERVER
