"""Artifacts are shared by all who have them, and in memory for nobody else."""

from weakref import ref

import pytest
from homsense_service.archive import Archive, Artifacts
from support.collecting import uncollected


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
