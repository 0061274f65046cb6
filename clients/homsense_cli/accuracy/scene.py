"""A site that has tuned itself to the scans of a crowd, without any position."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

from homsense_fleet.driver import Crowd
from homsense_fleet.world import World

from homsense import (
    CodeMap,
    Detection,
    Expectation,
    FieldNoise,
    FreeSpace,
    Hearing,
    LandmarkComplex,
    Profiles,
    RadioModel,
    SiteMap,
    choose_detection,
    detection_curve,
    estimate_radio,
    expect,
    krige,
)
from homsense.detection import LAST_SCAN
from homsense.expectation import HOPS
from homsense_cli.accuracy.crowd import RegisteredCrowd, by_device, walk_scan
from homsense_cli.accuracy.scenario import Scenario

CELL_M = 2.0
WEAKEST_DBM = -95.0


@dataclass(frozen=True)
class Scene:
    """A mapped site and what its sensor is expected to count.

    Parameters
    ----------
    site_map : SiteMap
        The unlabeled map.
    free_space : FreeSpace
        Where one can be.
    grown : LandmarkComplex
        What the crowd has built.
    profiles : Profiles
        Holes near each landmark.
    radio : RadioModel
        What the scans say about the radio.
    expectation : Expectation
        Of the counts.
    noise : FieldNoise
        Their error.
    crowd : RegisteredCrowd, optional
        The crowd on the map, where phones keep account of their motion.
    detection : Detection
        In how many of the last scans of a device a landmark must have been heard.
    """

    site_map: SiteMap
    free_space: FreeSpace
    grown: LandmarkComplex
    profiles: Profiles
    radio: RadioModel
    expectation: Expectation
    noise: FieldNoise
    crowd: RegisteredCrowd | None = None
    detection: Detection = LAST_SCAN

    @classmethod
    def of(
        cls,
        site_map: SiteMap,
        free_space: FreeSpace,
        crowd: Sequence[tuple[str, frozenset[str]]],
        model: "Tuned",
        registered: RegisteredCrowd | None = None,
    ) -> "Scene":
        """Return the scene of a crowd's scans.

        Parameters
        ----------
        site_map : SiteMap
            The map.
        free_space : FreeSpace
            Its free cells.
        crowd : sequence of (str, frozenset of str)
            Whose scan, and what it has heard; those of a device in the order of time.
        model : Tuned
            What the site has learnt.
        registered : RegisteredCrowd, optional
            The same crowd on the map.

        Returns
        -------
        Scene
            Ready for robots.
        """
        heard_by = [seen for _, seen in crowd]
        grown = LandmarkComplex.from_observations(seen for seen in heard_by if seen)
        landmarks, expectation = sorted(grown.landmarks), model.expectation
        profiles = Profiles(grown, expectation.hops)
        if registered is not None and registered.is_sure:
            counted = registered.counted(profiles, heard_by)
            expectation = krige(expectation, counted, profiles.table(landmarks))
        expectation = expectation.narrowed(model.hops or expectation.best_hops)
        if profiles.hops != expectation.hops:
            profiles = Profiles(grown, expectation.hops)
        noise = expectation.noise(profiles.table(landmarks))
        best = choose_detection(detection_curve(by_device(crowd), profiles))
        detection = LAST_SCAN if best is None else best.detection
        return cls(
            site_map,
            free_space,
            grown,
            profiles,
            model.radio,
            expectation,
            noise,
            registered,
            detection,
        )

    def counts(self, latest: Sequence[frozenset[str]]) -> tuple[float, ...] | None:
        """Return what a device counts that had this in view in its scans, the latest at the end.

        Parameters
        ----------
        latest : sequence of frozenset of str
            As many as there were, or the last five.

        Returns
        -------
        tuple of float, optional
            Holes; None when nothing known is in view.
        """
        return self.profiles.mean_holes(self.detection.in_view(latest))

    @cached_property
    def code_map(self) -> CodeMap:
        """What is expected where."""
        expected = self.expectation
        return CodeMap.of(self.free_space, (*expected.heights, *expected.spreads))

    def describe(self) -> dict[str, Any]:
        """Return what the site has learnt about itself."""
        placed = self.crowd and self.crowd.registered.registration
        return {
            "crowd_bits": self.crowd and round(self.crowd.likelihood.information_bits, 2),
            "registration_cost_m": placed and round(placed.cost_m, 2),
            "registration_margin_m": placed and round(placed.margin_m, 2),
            "mirror_margin_m": placed and round(placed.mirror_margin_m, 2),
            "strain": placed and round(placed.strain, 2),
            "structures": len(self.site_map.structures),
            "betti": list(self.grown.betti_numbers()),
            "landmarks": self.grown.n_landmarks,
            "facets": self.grown.n_facets,
            "range_m": round(self.radio.range_m, 1),
            "dropout": self.radio.dropout,
            "evenness": self.radio.evenness,
            "detection": list(self.detection),
            "hops": list(self.expectation.hops),
            "correlation_m": round(self.expectation.correlation_m, 1),
            "information_bits": [round(bits, 2) for bits in self.expectation.information_bits],
        }


@dataclass(frozen=True)
class CityScene:
    """A generated world, which only robots know, and the site that a crowd has made of it."""

    scenario: Scenario
    world: World
    scene: Scene


class Tuned(NamedTuple):
    """What a site has learnt without any label.

    Parameters
    ----------
    radio : RadioModel
        How transmitters are heard.
    expectation : Expectation
        What is counted where, on sites like this one.
    hops : sequence of int, optional
        Neighborhoods to count; chosen by the information they carry when absent.
    """

    radio: RadioModel
    expectation: Expectation
    hops: Sequence[int] | None


def tuned(
    free_space: FreeSpace,
    crowd: Sequence[frozenset[str]],
    hops: Sequence[int] | None,
    seed: int,
    placed: RegisteredCrowd | None = None,
) -> Tuned:
    """Return what a site learns from its scans about its radio and its sensor.

    Parameters
    ----------
    free_space : FreeSpace
        Of its map.
    crowd : sequence of frozenset of str
        What each scan has heard.
    hops : sequence of int, optional
        Neighborhoods; chosen by the site when absent.
    seed : int
        Of the simulated placements.
    placed : RegisteredCrowd, optional
        The same crowd on the map: where it walks.

    Returns
    -------
    Tuned
        Without any label.
    """
    walked, heard = None, crowd
    if placed is not None and placed.is_sure:
        made, walked = placed.been
        heard = [crowd[number] for number in made.tolist()]
    radio = estimate_radio(
        free_space,
        heard,
        transmitters=len(frozenset().union(*crowd)),
        scans=sum(map(bool, crowd)),
        walked=walked,
        seed=seed,
    )
    return Tuned(radio, expect(free_space, radio, hops or HOPS, walked=walked, seed=seed), hops)


def prepare(
    scenario: Scenario, hops: Sequence[int] | None = None, *, tracked: bool = True
) -> CityScene:
    """Let a crowd map a world, and the site tune itself.

    Parameters
    ----------
    scenario : Scenario
        The world.
    hops : sequence of int, optional
        Neighborhoods; chosen by the site when absent.
    tracked : bool, default True
        Whether phones keep account of their motion, so that the crowd finds its place.

    Returns
    -------
    CityScene
        Ready for robots.
    """
    world = scenario.world()
    site_map = SiteMap.from_geojson(world.map_document())
    free_space = FreeSpace.of(site_map, CELL_M)
    phones = Crowd(scenario.seed, scenario.phones, scenario.scans_each)
    scans = [scan for number in range(phones.phones) for scan in phones.scans(world, number)]
    crowd = [frozenset(entry["id"] for entry in scan["landmarks"]) for scan in scans]
    placed = None
    if tracked:
        hearing, walks = Hearing(weakest_dbm=WEAKEST_DBM), map(walk_scan, scans)
        placed = RegisteredCrowd.of(walks, site_map, free_space, free_space, hearing)
    model = tuned(free_space, crowd, hops, scenario.seed, placed)
    seen_by = [(scan["device"], seen) for scan, seen in zip(scans, crowd, strict=True)]
    return CityScene(scenario, world, Scene.of(site_map, free_space, seen_by, model, placed))
