"""What sessions measure with, as documents and artifacts that survive a restart.

An artifact is named by its hash and shared by all sessions that refer to it.
"""

import hashlib
import json
import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import asdict
from typing import Any, TypeVar, cast
from weakref import WeakValueDictionary, ref

import numpy as np

import homsense
from homsense.backend import NUMPY
from homsense.grid import Grid
from homsense.registered.matching import Placement
from homsense.registered.registration import Registration
from homsense_service.bundles import bundled, unbundled
from homsense_service.records import tupled
from homsense_service.registering import Registered
from homsense_service.sensors import Sensor
from homsense_service.versions import MapVersion

Thing = TypeVar("Thing")

Artifacts = dict[str, Callable[[], bytes]]
"""How artifacts are written, by digest; asked only for those that the store does not have."""

_REMEMBERED = 256


class Archive:
    """Artifacts by content; what somebody has in memory is shared, the rest is read again.

    Parameters
    ----------
    read : callable
        Returns the bytes of an artifact by its digest.
    """

    def __init__(self, read: Callable[[str], bytes]) -> None:
        self._read = read
        self._lock = threading.Lock()
        self._digests: OrderedDict[int, tuple[ref[object], str]] = OrderedDict()
        self._things: WeakValueDictionary[str, object] = WeakValueDictionary()

    def keep(self, thing: object, to_bytes: Callable[[], bytes], artifacts: Artifacts) -> str:
        """Return the digest of a thing and note among `artifacts` how it is written."""
        with self._lock:
            known = self._digests.get(id(thing))
        if known is not None and known[0]() is thing:
            digest = known[1]
        else:
            digest = hashlib.sha256(to_bytes()).hexdigest()
            self._remember(thing, digest)
        artifacts[digest] = to_bytes
        return digest

    def get(self, digest: str, from_bytes: Callable[[bytes], Thing]) -> Thing:
        """Return the thing of a digest, the same one while it is remembered."""
        with self._lock:
            known = self._things.get(digest)
        if known is None:
            known = from_bytes(self._read(digest))
            self._remember(known, digest)
        return cast("Thing", known)

    def _remember(self, thing: object, digest: str) -> None:
        with self._lock:
            self._digests[id(thing)] = ref(thing), digest
            self._things[digest] = thing
            while len(self._digests) > _REMEMBERED:
                self._digests.popitem(last=False)


def sensor_document(sensor: Sensor, archive: Archive, artifacts: Artifacts) -> dict[str, Any]:
    """Return how a session measures, and note the artifacts that it refers to.

    Parameters
    ----------
    sensor : Sensor
        As the session has it.
    archive : Archive
        Knows what is kept.
    artifacts : dict
        Is added to.

    Returns
    -------
    dict
        For `sensor_of`.
    """
    heights = [
        archive.keep(height, lambda height=height: _height_bytes(height), artifacts)  # type: ignore[misc]
        for height in sensor.heights
    ]
    found = sensor.registered
    return {
        "hops": sensor.hops,
        "expected": sensor.expected,
        "heights": heights,
        "noise": None if sensor.noise is None else asdict(sensor.noise),
        "detection": sensor.detection,
        "registered": None
        if found is None
        else archive.keep(found, lambda: _registered_bytes(found), artifacts),
    }


def sensor_of(
    document: dict[str, Any],
    archive: Archive,
    version: MapVersion,
    reachable: homsense.FreeSpace,
) -> Sensor:
    """Return the sensor that a document tells of.

    Parameters
    ----------
    document : dict
        From `sensor_document`.
    archive : Archive
        Gives the artifacts.
    version : MapVersion
        The map that the sensor is for.
    reachable : homsense.FreeSpace
        Where devices are looked for on it.

    Returns
    -------
    Sensor
        Weighs as the one that it is from, to the last bit.
    """
    noise, registered = document["noise"], document["registered"]
    return Sensor(
        tuple(document["hops"]),
        document["expected"],
        tuple(archive.get(digest, _height) for digest in document["heights"]),
        None if noise is None else homsense.FieldNoise(**tupled(noise)),
        homsense.Detection(*document.get("detection", ())),
        None
        if registered is None
        else archive.get(registered, lambda body: _registered(body, version, reachable)),
    )


def _height_bytes(height: homsense.HeightMap) -> bytes:
    document = {"grid": asdict(height.grid), "r_geo_m": height.r_geo_m}
    return bundled(document, {"values": height.values})


def _height(body: bytes) -> homsense.HeightMap:
    document, arrays = unbundled(body)
    return homsense.HeightMap(Grid(**document["grid"]), arrays["values"], document["r_geo_m"])


def _registered_bytes(found: Registered) -> bytes:
    crowd, reachable = found.likelihood.complex, found.likelihood.code_map.free_space
    document = {
        "map": found.map_digest,
        "reachable": hashlib.sha256(reachable.free.tobytes()).hexdigest(),
        "scans": found.scans,
        "coverage": found.coverage,
        "information_bits": found.information_bits,
        "share": found.likelihood.share,
        "hearing": asdict(crowd.hearing),
        "signatures": [dict(signature) for signature in crowd.signatures],
        "reach_m": crowd.reach_m,
        "placements": crowd.registration.placements,
        "mirror_margin_m": crowd.registration.mirror_margin_m,
        "strain": crowd.registration.strain,
    }
    arrays = {"walk": crowd.walk, "xy": crowd.xy, "source": crowd.source}
    return bundled(document, {**arrays, "rivals": np.array(crowd.rivals)})


def _registered(body: bytes, version: MapVersion, reachable: homsense.FreeSpace) -> Registered:
    document, arrays = unbundled(body)
    crowd = homsense.RegisteredComplex(
        homsense.Hearing(**document["hearing"]),
        arrays["walk"],
        arrays["xy"],
        tuple(document["signatures"]),
        document["reach_m"],
        Registration(
            tuple(Placement(*placement) for placement in document["placements"]),
            document["mirror_margin_m"],
            document.get("strain", 0.0),
        ),
        arrays["source"],
        tuple(arrays["rivals"]),
    )
    # Whoever localizes with it runs it by the backend of the day.
    share = document.get("share")
    likelihood = homsense.RadioMapLikelihood(crowd, reachable, NUMPY, share)
    nobody = np.empty((0, 2))
    return Registered(
        version,
        document["scans"],
        crowd,
        likelihood,
        document["coverage"],
        document["information_bits"],
        nobody,
        (),
        nobody,
    )


def map_bytes(version: MapVersion) -> bytes:
    """Return the map of a session as an artifact."""
    return json.dumps([version.document, version.origin, version.free_space.grid.cell_m]).encode()


def map_of(body: bytes) -> MapVersion:
    """Return the map that an artifact tells of."""
    document, origin, cell_m = json.loads(body)
    return MapVersion.read(document, None if origin is None else tuple(origin), cell_m)
