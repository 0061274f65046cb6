"""Artifacts are shared by all who have them, and in memory for nobody else."""

from dataclasses import replace
from weakref import ref

import numpy as np
import pytest
from homsense_service.archive import Archive, Artifacts, sensor_document, sensor_of
from homsense_service.bundles import bundled, unbundled
from homsense_service.registering import Registered
from homsense_service.sensors import Sensor
from homsense_service.versions import MapVersion
from support.collecting import uncollected
from support.corridors import Building

from homsense import RadioMapLikelihood, register_crowd


class Crowd:
    """Something large."""


@pytest.fixture
def stored() -> dict[str, bytes]:
    return {}


def kept(archive: Archive, stored: dict[str, bytes], thing: object) -> str:
    artifacts: Artifacts = {}
    digest = archive.keep(thing, lambda: b"large", artifacts)
    stored.update({name: write() for name, write in artifacts.items()})
    return digest


def test_what_somebody_has_is_not_read_again(stored: dict[str, bytes]) -> None:
    archive, thing = Archive(stored.__getitem__), Crowd()
    digest = kept(archive, stored, thing)
    stored.clear()
    assert archive.get(digest, lambda _: Crowd()) is thing


def test_what_nobody_has_is_out_of_memory_and_read_again_once(stored: dict[str, bytes]) -> None:
    archive, thing = Archive(stored.__getitem__), Crowd()
    digest, gone = kept(archive, stored, thing), ref(thing)
    with uncollected():
        del thing
        assert gone() is None
    again = archive.get(digest, lambda _: Crowd())
    stored.clear()
    assert archive.get(digest, lambda _: Crowd()) is again


def test_a_thing_at_the_address_of_another_is_not_taken_for_it(stored: dict[str, bytes]) -> None:
    archive = Archive(stored.__getitem__)
    for number in range(100):
        thing, artifacts = Crowd(), Artifacts()
        body = str(number).encode()
        digest = archive.keep(thing, lambda body=body: body, artifacts)  # type: ignore[misc]
        assert artifacts[digest]() == body


@pytest.mark.parametrize("is_old", [False, True])
def test_a_crowd_is_read_as_it_was_kept_also_from_before_there_was_strain(
    stored: dict[str, bytes],
    is_old: bool,  # noqa: FBT001 - of two
) -> None:
    building = Building.of(0)
    crowd = register_crowd(building.crowd(10, 40), building.free_space)
    version = MapVersion({}, building.site_map, building.free_space, "digest")
    place = RadioMapLikelihood(crowd, building.free_space)
    nobody = np.empty((0, 2))
    found = Registered(version, crowd.size, crowd, place, 0.5, 4.0, nobody, (), nobody)
    artifacts: Artifacts = {}
    document = sensor_document(Sensor(registered=found), Archive(stored.__getitem__), artifacts)
    stored.update({name: write() for name, write in artifacts.items()})
    if is_old:
        kept_as, arrays = unbundled(stored[document["registered"]])
        del kept_as["strain"], kept_as["share"]
        stored[document["registered"]] = bundled(kept_as, arrays)
    archive = Archive(stored.__getitem__)
    again = sensor_of(document, archive, version, building.free_space).registered
    assert again is not None
    assert np.array_equal(again.complex.xy, crowd.xy)
    known = replace(crowd.registration, strain=0.0) if is_old else crowd.registration
    assert again.complex.registration == known
    assert crowd.registration.strain > 0.0
    assert again.likelihood.share == place.share
