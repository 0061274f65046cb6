"""All devices that stream, and into which sessions."""

import threading
from collections import Counter
from collections.abc import Callable, Iterable

from homsense_service.bridge.device import Device
from homsense_service.bridge.presence import State
from homsense_service.errors import DeviceNotFoundError
from homsense_service.records import Binding

Tell = Callable[[str, str, str], None]


class Devices:
    """Devices by name and by session; those that are gone come back from their bindings.

    Parameters
    ----------
    bindings : iterable of Binding
        From the store.
    make : callable
        Returns the device of a binding.
    tell : callable
        Told device, code and detail when one comes or goes.
    """

    def __init__(
        self, bindings: Iterable[Binding], make: Callable[[Binding], Device], tell: Tell
    ) -> None:
        self._make, self._tell = make, tell
        self._lock = threading.Lock()
        self._bindings = {binding.device: binding for binding in bindings}
        self._present: dict[str, Device] = {}
        self._of_session: dict[str, Device] = {}
        self._offline: set[str] = set()

    def binding(self, name: str) -> Binding | None:
        """Return which session a device streams into."""
        return self._bindings.get(name)

    def present(self, name: str) -> Device | None:
        """Return a device that is in memory."""
        return self._present.get(name)

    def of_session(self, session: str) -> Device | None:
        """Return the device in memory that streams into a session."""
        return self._of_session.get(session)

    def get(self, name: str) -> Device:
        """Return a device.

        Raises
        ------
        DeviceNotFoundError
            If it has no session.
        """
        if (device := self._present.get(name)) is not None:
            return device
        with self._lock:
            binding = self._bindings.get(name)
            if binding is None:
                raise DeviceNotFoundError(name)
            if name not in self._present:
                device = self._make(binding)
                self._present[name] = self._of_session[binding.session] = device
            return self._present[name]

    def adopt(self, binding: Binding) -> None:
        """Let a device stream into a session, and no other into the same."""
        if self._bindings.get(binding.device) != binding:
            others = [b for b in [*self._bindings.values()] if b.session == binding.session]
            for other in [*others, binding]:
                self.forget(other.device)
            with self._lock:
                self._bindings[binding.device] = binding
        self.get(binding.device)

    def forget(self, name: str) -> None:
        """Let a device go for good."""
        with self._lock:
            self._bindings.pop(name, None)
        self._drop(name)

    def look(self, now_s: float) -> Counter[State]:
        """Tell who has come and gone since the last look, and count who is there."""
        states = {name: d.presence.state(now_s) for name, d in [*self._present.items()]}
        for name, state in states.items():
            if (state == "online") == (name in self._offline):
                self._tell(name, state, f"the device is {state}")
            if state == "online":
                self._offline.discard(name)
            else:
                self._offline.add(name)
            if state == "gone":
                self._drop(name)
        return Counter(states.values())

    def _drop(self, name: str) -> None:
        """Let a device leave the memory."""
        with self._lock:
            device = self._present.pop(name, None)
            if device is not None:
                self._of_session.pop(device.session, None)
            self._offline.discard(name)
        if device is not None:
            device.close()
