"""What a site has learnt about itself -> wire."""

import homsense
from homsense_service import schemas
from homsense_service.expecting import Expecting, Learnt


def render_expectation(expecting: Expecting) -> schemas.ExpectationOut:
    """Return how far a simulation is."""
    progress, known = expecting.progress, expecting.current
    return schemas.ExpectationOut(
        state=progress.state,
        done=progress.done,
        of=expecting.words.steps,
        reason=progress.reason,
        learnt=None if known is None else _learnt(known),
    )


def _learnt(known: Learnt) -> schemas.LearntOut:
    radio, expectation = known.radio, known.expectation
    return schemas.LearntOut(
        map_version=known.map_digest,
        scans=known.scans,
        transmitters=radio.transmitters,
        range_m=radio.range_m,
        dropout=radio.dropout,
        evenness=radio.evenness,
        knows_crowd=known.knows_crowd,
        hops=list(expectation.best_hops),
        information_bits=list(expectation.information_bits),
        correlation_m=expectation.correlation_m,
    )


def render_diagnosis(diagnosis: homsense.Diagnosis) -> schemas.DiagnosisOut:
    """Return what was found about a site."""
    return schemas.DiagnosisOut(
        verdict=diagnosis.verdict,
        summary=diagnosis.summary,
        findings=[_finding(finding) for finding in diagnosis.findings],
    )


def _finding(finding: homsense.Finding) -> schemas.FindingOut:
    return schemas.FindingOut(
        topic=finding.topic,
        verdict=finding.verdict,
        text=finding.text,
        advice=finding.advice,
        setting=None if finding.setting is None else _setting(*finding.setting),
    )


def _setting(name: str, value: float | homsense.Detection) -> dict[str, float | list[int]]:
    return {name: list(value) if isinstance(value, homsense.Detection) else value}
