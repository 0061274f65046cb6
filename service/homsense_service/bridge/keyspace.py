"""Which key expressions there are; ``openapi/keyexpr.md`` says what goes over them."""

import re
from typing import NamedTuple

VERSION = "@v1"
METHODS = ("open", "scan", "steps", "last", "close")
DEVICE = r"[A-Za-z0-9_.-]{1,64}"
_OF_DEVICE = re.compile(rf"/{VERSION}/(?:dev|alive)/({DEVICE})(?:/[^*]*)?")


def is_device(name: str) -> bool:
    """Tell whether a device may have a name.

    Examples
    --------
    >>> is_device("r1"), is_device("*"), is_device("a/b")
    (True, False, False)
    """
    return re.fullmatch(DEVICE, name) is not None


class KeySpace(NamedTuple):
    """All keys below one prefix.

    Parameters
    ----------
    prefix : str
        As the operator has set it.

    Examples
    --------
    >>> keys = KeySpace("homsense")
    >>> keys.of_device("r1", "imu")
    'homsense/@v1/dev/r1/imu'
    >>> keys.device_of("homsense/@v1/dev/r1/imu"), keys.device_of("homsense/@v1/dev/*/imu")
    ('r1', None)
    """

    prefix: str

    @property
    def root(self) -> str:
        """What all keys begin with; the verbatim chunk keeps versions apart."""
        return f"{self.prefix}/{VERSION}"

    def of_device(self, device: str, what: str) -> str:
        """Return the key of a stream of a device; `*` stands for all devices."""
        return f"{self.root}/dev/{device}/{what}"

    def rpc(self, device: str, method: str) -> str:
        """Return the key of a request of a device."""
        return self.of_device(device, f"rpc/{method}")

    def alive(self, device: str) -> str:
        """Return the key of the liveliness token of a device."""
        return f"{self.root}/alive/{device}"

    def service(self, zid: str) -> str:
        """Return the key of the liveliness token of a service."""
        return f"{self.root}/svc/{zid}"

    def device_of(self, key: str) -> str | None:
        """Return the device that a key is of; None unless it names exactly one."""
        if not key.startswith(self.prefix):
            return None
        found = _OF_DEVICE.fullmatch(key, len(self.prefix))
        return None if found is None else found[1]
