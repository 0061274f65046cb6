"""A site that has tuned itself to the scans of a crowd, without any position."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from homsense_fleet.driver import Crowd
from homsense_fleet.world import World

from homsense import (
    Expectation,
    FieldNoise,
    FreeSpace,
    LandmarkComplex,
    Profiles,
    RadioModel,
    SiteMap,
    estimate_radio,
    expect,
)
from homsense.expectation import HOPS
from homsense_cli.accuracy.scenario import Scenario

CELL_M = 2.0


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
    """

    site_map: SiteMap
    free_space: FreeSpace
    grown: LandmarkComplex
    profiles: Profiles
    radio: RadioModel
    expectation: Expectation
    noise: FieldNoise

    @classmethod
    def of(
        cls,
        site_map: SiteMap,
        free_space: FreeSpace,
        crowd: Iterable[frozenset[str]],
        model: tuple[RadioModel, Expectation],
    ) -> "Scene":
        """Return the scene of a crowd's scans.

        Parameters
        ----------
        site_map : SiteMap
            The map.
        free_space : FreeSpace
            Its free cells.
        crowd : iterable of frozenset of str
            What each scan has heard.
        model : tuple of RadioModel and Expectation
            From `tuned`.

        Returns
        -------
        Scene
            Ready for robots.
        """
        grown = LandmarkComplex.from_observations(seen for seen in crowd if seen)
        radio, expectation = model
        profiles = Profiles(grown, expectation.hops)
        noise = expectation.noise(profiles.table(sorted(grown.landmarks)))
        return cls(site_map, free_space, grown, profiles, radio, expectation, noise)

    def describe(self) -> dict[str, Any]:
        """Return what the site has learnt about itself."""
        return {
            "structures": len(self.site_map.structures),
            "betti": list(self.grown.betti_numbers()),
            "landmarks": self.grown.n_landmarks,
            "facets": self.grown.n_facets,
            "range_m": round(self.radio.range_m, 1),
            "dropout": self.radio.dropout,
            "evenness": self.radio.evenness,
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


def tuned(
    free_space: FreeSpace,
    crowd: Sequence[frozenset[str]],
    hops: Sequence[int] | None,
    seed: int,
) -> tuple[RadioModel, Expectation]:
    """Return what a site learns from its scans about its radio and its sensor.

    Parameters
    ----------
    free_space : FreeSpace
        Of its map.
    crowd : sequence of frozenset of str
        What each scan has heard.
    hops : sequence of int, optional
        Neighborhoods; chosen by the information they carry when absent.
    seed : int
        Of the simulated placements.

    Returns
    -------
    tuple of RadioModel and Expectation
        Without any position.
    """
    radio = estimate_radio(free_space, crowd, seed=seed)
    expected = expect(free_space, radio, hops or HOPS, seed=seed)
    return radio, expected.narrowed(hops or expected.best_hops)


def prepare(scenario: Scenario, hops: Sequence[int] | None = None) -> CityScene:
    """Let a crowd map a world, and the site tune itself.

    Parameters
    ----------
    scenario : Scenario
        The world.
    hops : sequence of int, optional
        Neighborhoods; chosen by the site when absent.

    Returns
    -------
    CityScene
        Ready for robots.
    """
    world = scenario.world()
    site_map = SiteMap.from_geojson(world.map_document())
    free_space = FreeSpace.of(site_map, CELL_M)
    phones = Crowd(scenario.seed, scenario.phones, scenario.scans_each)
    crowd = [
        frozenset(entry["id"] for entry in scan["landmarks"])
        for number in range(phones.phones)
        for scan in phones.scans(world, number)
    ]
    model = tuned(free_space, crowd, hops, scenario.seed)
    return CityScene(scenario, world, Scene.of(site_map, free_space, crowd, model))
