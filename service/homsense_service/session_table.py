"""All sessions; idle ones, and those of before the last start, sleep until they are asked for."""

import threading
from collections.abc import Callable, Iterable

from homsense_service.errors import CapacityError, SessionNotFoundError
from homsense_service.records import SessionRecord
from homsense_service.sessions import Session
from homsense_service.store import Store


class SessionTable:
    """All sessions that were not closed.

    Parameters
    ----------
    capacity : int
        How many there may be.
    store : Store
        Where they survive.
    wake : callable
        Returns a session as its journal tells.
    clock : callable
        Returns seconds.
    """

    def __init__(
        self,
        capacity: int,
        store: Store,
        wake: Callable[[SessionRecord], Session],
        clock: Callable[[], float],
    ) -> None:
        self._capacity, self._store, self._wake = capacity, store, wake
        self._clock = clock
        self._lock = threading.Lock()
        self._waking: dict[str, threading.Lock] = {}
        self._asleep = {record.name: record for record in store.sessions()}
        self._awake: dict[str, Session] = {}
        self._asked = {key: r.name for r in self._asleep.values() if (key := _asked_as(r))}
        self._opening = 0
        self._used_s = dict.fromkeys(self._asleep, clock())

    def admit(self, keep: Callable[[], Session]) -> Session:
        """Add the session that a function has kept in the store, if there is room."""
        with self._lock:
            if len(self) + self._opening >= self._capacity:
                message = f"there are {self._capacity} sessions already"
                raise CapacityError(message)
            self._opening += 1
        try:
            session = keep()
            self._used_s[session.name] = self._clock()
            self._awake[session.name] = session
            if (key := _asked_as(session.record)) is not None:
                self._asked[key] = session.name
        finally:
            with self._lock:
                self._opening -= 1
        return session

    def asked_as(self, key: str) -> str | None:
        """Return the session that was opened by a named request, if it is still open."""
        return self._asked.get(key)

    def get(self, name: str) -> Session:
        """Return a session, as it was before a restart if need be.

        Raises
        ------
        SessionNotFoundError
            If there is none.
        """
        if name in self._used_s:
            self._used_s[name] = self._clock()
        if (awake := self._awake.get(name)) is not None:
            return awake
        with self._lock:
            waking = self._waking.setdefault(name, threading.Lock())
        with waking:
            record = self._asleep.get(name)
            if record is not None:
                self._awake[name] = self._wake(record)
                self._asleep.pop(name, None)
            with self._lock:
                self._waking.pop(name, None)
        try:
            return self._awake[name]
        except KeyError:
            raise SessionNotFoundError(name) from None

    def site_of(self, name: str) -> str:
        """Return the name of the site of a session, without waking it."""
        if (awake := self._awake.get(name)) is not None:
            return awake.site.name
        if (asleep := self._asleep.get(name)) is not None:
            return asleep.site
        raise SessionNotFoundError(name)

    def close(self, name: str) -> None:
        """Forget a session."""
        self.site_of(name)
        self._store.close_session(name)
        self._forget([name])

    def forget_site(self, site: str) -> None:
        """Forget all sessions of a site that is no more."""
        self._forget(self.of_site(site))

    def tidy(self, sleep_s: float, expiry_s: float) -> list[str]:
        """Let idle sessions sleep, close those that are idle for too long, and name them.

        Parameters
        ----------
        sleep_s, expiry_s : float
            How long they are idle, seconds.

        Returns
        -------
        list of str
            Those that were closed.
        """
        now_s = self._clock()
        idle_s = {name: now_s - used_s for name, used_s in list(self._used_s.items())}
        expired = [name for name, idle in idle_s.items() if idle >= expiry_s]
        for name in expired:
            self.close(name)
        for name, session in list(self._awake.items()):
            if idle_s.get(name, 0.0) >= sleep_s and session.rest():
                self._asleep[name] = session.record
                self._awake.pop(name, None)
        return expired

    def sites(self) -> list[str]:
        """Return the name of the site of each session."""
        awake = [session.site.name for session in self._awake.values()]
        return [*awake, *(record.site for record in self._asleep.values())]

    def of_site(self, site: str) -> list[str]:
        """Return the names of the sessions of a site."""
        return [name for name in self.names() if self.site_of(name) == site]

    def names(self) -> list[str]:
        """Return the names of all sessions."""
        return [*self._awake, *self._asleep]

    def _forget(self, names: Iterable[str]) -> None:
        gone = set(names)
        with self._lock:
            self._asked = {key: name for key, name in self._asked.items() if name not in gone}
            for name in gone:
                self._awake.pop(name, None)
                self._asleep.pop(name, None)
                self._used_s.pop(name, None)

    @property
    def awake(self) -> int:
        """How many are in memory."""
        return len(self._awake)

    def __len__(self) -> int:
        return len(self._used_s)


def _asked_as(record: SessionRecord) -> str | None:
    """Return the name of the request that has opened a session."""
    found: str | None = record.document.get("asked_as")
    return found
