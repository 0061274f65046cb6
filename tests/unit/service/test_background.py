"""What a site learns is learnt anew when it could be different, and only then."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import pytest
from homsense_service.background import Background, Builder, Words
from homsense_service.errors import RegistrationFailedError, RegistrationPendingError
from homsense_service.versions import MapVersion
from support.builders import SITE_MAP
from support.networks import until

from homsense.engine import fastest
from homsense.errors import HomsenseError

WORDS = Words("at it", "cannot be", 1, RegistrationPendingError, RegistrationFailedError)
MAP = MapVersion.read(SITE_MAP, None, 4.0)


@dataclass(frozen=True)
class Asked:
    """A question about one map."""

    scans: int
    conditions: str = "as before"
    map_version: MapVersion = MAP


@dataclass(frozen=True)
class Told:
    """Its answer."""

    scans: int
    map_digest: str = MAP.digest


class Learner(Background[Asked, Told]):
    """Answers, or fails, and counts how often it was asked."""

    error: Exception | None = None
    tried = 0

    def _build(self, question: Asked, _on_step: Callable[[int], None]) -> Told:
        self.tried += 1
        if self.error is not None:
            raise self.error
        return Told(question.scans)


@pytest.fixture
def learner() -> Iterator[Learner]:
    builder = Builder(fastest)
    yield Learner(builder, WORDS)
    builder.close()


def _settled(learner: Learner, question: Asked) -> None:
    if (building := learner.refresh(question)) is not None:
        building.exception(timeout=10.0)


def test_what_holds_is_not_learnt_again(learner: Learner) -> None:
    for scans in (100, 101, 125):
        assert learner.learnt(Asked(scans), 10.0).scans == 100
    assert learner.tried == 1


@pytest.mark.parametrize("changed", [Asked(126), Asked(99), Asked(100, "another cut")])
def test_it_is_learnt_again_when_scans_or_conditions_have_changed(
    learner: Learner, changed: Asked
) -> None:
    learner.learnt(Asked(100), 10.0)
    _settled(learner, changed)
    assert learner.tried == 2
    assert learner.learnt(changed, 10.0).scans == changed.scans


def test_what_cannot_be_learnt_is_tried_again_from_more_scans_only(learner: Learner) -> None:
    learner.error = HomsenseError("too few")
    for _ in range(3):
        with pytest.raises(RegistrationFailedError, match="cannot be: too few"):
            learner.learnt(Asked(100), 10.0)
        assert learner.at_hand(Asked(110)) is None
    assert (learner.tried, learner.progress.state) == (1, "failed")
    learner.error = None
    assert learner.learnt(Asked(126), 10.0).scans == 126


@pytest.mark.parametrize(
    ("error", "again"),
    [
        (HomsenseError("no place"), Asked(100, "another cut")),
        (RuntimeError("the disk is away"), Asked(100)),
    ],
)
def test_what_may_go_well_now_is_tried_again(
    learner: Learner, error: Exception, again: Asked
) -> None:
    learner.error = error
    _settled(learner, Asked(100))
    learner.error = None
    assert learner.learnt(again, 10.0).scans == 100


def test_a_failure_that_is_remembered_holds_nothing_of_the_work(
    learner: Learner, caplog: pytest.LogCaptureFixture
) -> None:
    learner.error = HomsenseError("no place")
    for _ in range(2):
        with pytest.raises(RegistrationFailedError, match="cannot be: no place"):
            learner.learnt(Asked(100), 10.0)
    error = learner.error
    until(lambda: error.__traceback__ is None)
    assert not caplog.records


def test_a_failure_that_nobody_expects_is_logged(
    learner: Learner, caplog: pytest.LogCaptureFixture
) -> None:
    learner.error = ZeroDivisionError("by nothing")
    with pytest.raises(RegistrationFailedError, match="cannot be: by nothing"):
        learner.learnt(Asked(100), 10.0)
    assert "ZeroDivisionError: by nothing" in caplog.text
