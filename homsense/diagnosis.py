"""What a site is good for: whether counting holes can tell places apart in it, and why not."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from homsense.detection import LAST_SCAN, Detection, DetectionPoint, choose_detection
from homsense.expectation import Expectation
from homsense.radio import RadioModel
from homsense.range_check import RangePoint, choose_cut
from homsense.site_map import SiteMap
from homsense.witness_check import suggested_quorum

Verdict = Literal["good", "doubtful", "bad"]

GOOD_RANGE, LONG_RANGE = 0.8, 1.0
GOOD_BITS, FEW_BITS = 2.0, 0.75
FEW_IN_VIEW, MANY_IN_VIEW = 3.0, 60.0
USUAL_AGE_S = 3.0
UNLIKE = 2.0
_ORDER: tuple[Verdict, ...] = ("good", "doubtful", "bad")


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at.

    Parameters
    ----------
    topic : str
        What.
    verdict : {"good", "doubtful", "bad"}
        Whether it helps or hinders.
    text : str
        The figure, and what it means.
    advice : str
        What to do; empty when all is well.
    setting : tuple of (str, float or Detection), optional
        Member of the site's configuration, and the value to give it.
    """

    topic: str
    verdict: Verdict
    text: str
    advice: str = ""
    setting: tuple[str, float | Detection] | None = None


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """What was found about a site, and what follows.

    Parameters
    ----------
    findings : tuple of Finding
        In the order of the data's journey.
    verdict : {"good", "doubtful", "bad"}
        Whether the local count helps to localize on this site.
    summary : str
        The same in a sentence.
    """

    findings: tuple[Finding, ...]
    verdict: Verdict
    summary: str


def diagnose(  # noqa: PLR0913 - all that is known of a site
    site_map: SiteMap,
    radio: RadioModel,
    expected: Expectation,
    *,
    in_view: float,
    curve: Sequence[RangePoint] = (),
    min_rssi_dbm: float | None = None,
    median_witnesses: float | None = None,
    quorum: int = 1,
    stale_share: float = 0.0,
    foretold: Sequence[DetectionPoint] = (),
    detection: Detection = LAST_SCAN,
    gains: Sequence[float] = (),
) -> Diagnosis:
    """Judge a site by what it has learnt about itself.

    Parameters
    ----------
    site_map : SiteMap
        Its map.
    radio : RadioModel
        What its scans say about its radio.
    expected : Expectation
        What its sensor is expected to count.
    in_view : float
        Mean number of landmarks in a scan.
    curve : sequence of RangePoint, optional
        Its range self-check.
    min_rssi_dbm : float, optional
        The cut in force, dBm.
    median_witnesses : float, optional
        Distinct devices that have seen a landmark.
    quorum : int, default 1
        The quorum in force.
    stale_share : float, default 0.0
        Share of the readings that count and are older than three seconds.
    foretold : sequence of DetectionPoint, optional
        How well each detection foretells the next scan, from `detection_curve`.
    detection : Detection, optional
        The detection in force; the last scan alone by default.
    gains : sequence of float, optional
        Of the sensor, as `Expectation.noise` finds them from the site's own profiles.

    Returns
    -------
    Diagnosis
        Findings with advice.
    """
    findings = [
        _density(in_view),
        _range(site_map, radio),
        _dropout(radio),
        *_curve(curve, min_rssi_dbm),
        _staleness(stale_share),
        *_detection(foretold, detection),
        *_witnesses(median_witnesses, quorum),
        *_likeness(gains),
        _information(expected),
    ]
    decisive = [one.verdict for one in findings if one.topic in {"likeness", "information"}]
    verdict = max(decisive, key=_ORDER.index)
    words = {
        "good": "counting holes tells places apart on this site",
        "doubtful": "counting holes helps a little; expect slow convergence",
        "bad": "counting holes cannot help on this site as it is",
    }
    return Diagnosis(tuple(findings), verdict, words[verdict])


def _density(in_view: float) -> Finding:
    text = f"{in_view:.1f} landmarks in a scan"
    if in_view < FEW_IN_VIEW:
        return Finding("density", "doubtful", text, "more transmitters, or a weaker min_rssi_dbm")
    if in_view > MANY_IN_VIEW:
        return Finding("density", "doubtful", text, "a stronger min_rssi_dbm")
    return Finding("density", "good", text)


def _range(site_map: SiteMap, radio: RadioModel) -> Finding:
    pitch = math.sqrt(site_map.domain.area / len(site_map.structures))
    ratio = radio.range_m / pitch
    text = (
        f"range {radio.range_m:.0f} m, learnt from the scans; structures every {pitch:.0f} m: "
        f"ratio {ratio:.2f}"
    )
    if ratio <= GOOD_RANGE:
        return Finding("range", "good", text)
    verdict: Verdict = "doubtful" if ratio <= LONG_RANGE else "bad"
    return Finding("range", verdict, text, "holes fill in: a stronger min_rssi_dbm")


def _dropout(radio: RadioModel) -> Finding:
    text = f"{radio.dropout:.0%} of the transmitters in view are missed, evenness {radio.evenness}"
    if radio.dropout <= 0.2:  # noqa: PLR2004 - a fifth
        return Finding("dropout", "good", text)
    return Finding("dropout", "doubtful", text, "longer scans")


def _curve(curve: Sequence[RangePoint], cut_dbm: float | None) -> list[Finding]:
    if not curve:
        return []
    now = curve[-1]
    for point in curve:
        if cut_dbm is not None and point.min_rssi_dbm >= cut_dbm:
            now = point
    parts = now.betti[0]
    parts, holes = now.betti
    whole: Verdict = "good" if parts == 1 else "doubtful"
    findings = [
        Finding(
            "fragmentation",
            whole,
            f"b0 = {parts}, b1 = {holes}",
            "" if whole == "good" else "more scans between the parts, or a longer range",
        )
    ]
    if now.alarm is not None:
        findings.append(
            Finding(
                "chi alarm",
                "doubtful" if now.alarm else "good",
                "chi is not b0 - b1: range too long, or missed detections"
                if now.alarm
                else "chi is b0 - b1",
                "a stronger min_rssi_dbm" if now.alarm else "",
            )
        )
    best = choose_cut(curve)
    if best is not None:
        same = cut_dbm == best.min_rssi_dbm or (cut_dbm is None and best is curve[-1])
        findings.append(
            Finding(
                "RSSI cut",
                "good" if same or now.stable == best.stable else "doubtful",
                f"{best.stable} holes last over the cut at {best.min_rssi_dbm:.0f} dBm, "
                f"{now.stable} at the cut in force",
                "" if same else f"min_rssi_dbm {best.min_rssi_dbm:.0f}",
                None if same else ("min_rssi_dbm", best.min_rssi_dbm),
            )
        )
    return findings


def _staleness(share: float) -> Finding:
    text = f"{share:.0%} of the readings are older than {USUAL_AGE_S:.0f} s"
    if share <= 0.05:  # noqa: PLR2004 - one in twenty
        return Finding("stale sightings", "good", text)
    advice = f"max_age_s {USUAL_AGE_S:.0f}"
    return Finding("stale sightings", "doubtful", text, advice, ("max_age_s", USUAL_AGE_S))


def _detection(foretold: Sequence[DetectionPoint], now: Detection) -> list[Finding]:
    best = choose_detection(foretold)
    if best is None:
        return []
    left = {point.detection: point.unexplained for point in foretold}
    share = 1.0 - best.unexplained
    text = f"what was heard in {best.detection} scans explains {share:.1%} of the next count"
    if best.detection == now:
        return [Finding("detection", "good", text)]
    if now in left:
        text += f", {now} {1 - left[now]:.1%}"
    advice = f"detection {[*best.detection]}"
    return [Finding("detection", "doubtful", text, advice, ("detection", best.detection))]


def _witnesses(median: float | None, quorum: int) -> list[Finding]:
    if median is None:
        return []
    wanted = suggested_quorum(median)
    text = f"a landmark was seen by {median:.0f} devices, quorum {quorum}"
    if wanted <= quorum:
        return [Finding("witnesses", "good", text)]
    return [Finding("witnesses", "doubtful", text, f"quorum {wanted}", ("quorum", wanted))]


def _likeness(gains: Sequence[float]) -> list[Finding]:
    """Judge whether holes are spread over the landmarks as in the simulated sites."""
    if not gains:
        return []
    factors = sorted(max(gain, 1.0 / gain) for gain in gains)
    middle, worst = factors[len(factors) // 2], factors[-1]
    text = (
        "the counts of this site vary over its landmarks as in simulated sites, to a factor of "
        f"{middle:.1f} (worst {worst:.1f})"
    )
    advice = "a line of sight does not decide what is heard here; do not trust counts"
    if middle > UNLIKE:
        return [Finding("likeness", "bad", text, advice)]
    if worst > UNLIKE:
        return [Finding("likeness", "doubtful", text, advice)]
    return [Finding("likeness", "good", text)]


def _information(expected: Expectation) -> Finding:
    levels = len(expected.best_hops)
    bits = expected.information_bits[levels - 1]
    text = (
        f"a scan tells {bits:.1f} bits about the place with hops 1 to {expected.best_hops[-1]}; "
        f"the next one is new after {expected.correlation_m:.0f} m"
    )
    verdict: Verdict = "good" if bits >= GOOD_BITS else "doubtful" if bits >= FEW_BITS else "bad"
    return Finding("information", verdict, text)
