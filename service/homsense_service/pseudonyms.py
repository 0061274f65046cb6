"""Identifiers of landmarks and devices: as they are compared, or behind keyed hashes."""

import hashlib
from dataclasses import dataclass, replace

from homsense_service.records import StoredReading, StoredScan

_BYTES = 12


def canonical(landmark: str, key: str) -> str:
    """Return an identifier as a site compares it: hardware addresses in lower case with colons."""
    return landmark.lower().replace("-", ":") if key == "bssid" else landmark


@dataclass(frozen=True, slots=True)
class Pseudonyms:
    """Names in place of names; nobody without the key can tell which, nor make them.

    Parameters
    ----------
    secret : bytes, optional
        The key; names stay as they are when absent.
    """

    secret: bytes | None = None

    def device(self, name: str) -> str:
        """Return what stands for a device."""
        return name if self.secret is None else self._hashed("device", name)

    def readings(
        self, readings: tuple[StoredReading, ...], landmark_key: str
    ) -> tuple[StoredReading, ...]:
        """Return readings whose landmarks are hidden."""
        if self.secret is None:
            return readings
        return tuple(
            r._replace(landmark=self._hashed("landmark", canonical(r.landmark, landmark_key)))
            for r in readings
        )

    def scan(self, scan: StoredScan, landmark_key: str) -> StoredScan:
        """Return a scan whose device and landmarks are hidden."""
        if self.secret is None:
            return scan
        readings = self.readings(scan.readings, landmark_key)
        return replace(scan, device=self.device(scan.device), readings=readings)

    def _hashed(self, kind: str, name: str) -> str:
        assert self.secret is not None
        hashed = hashlib.blake2b(
            name.encode(), key=self.secret, digest_size=_BYTES, person=kind.encode()
        )
        return hashed.hexdigest()
