"""A site that has tuned itself to the scans of a crowd, without any position."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

from homsense_fleet.driver import Crowd
from homsense_fleet.world import World

from homsense import (
    CodeMap,
    Counted,
    Expectation,
    FieldNoise,
    FreeSpace,
    Hearing,
    InvalidInputError,
    LandmarkComplex,
    PlaceLikelihood,
    Profiles,
    RadioModel,
    Reading,
    RegisteredComplex,
    Retraced,
    SiteMap,
    WalkScan,
    estimate_radio,
    expect,
    krige,
    register_crowd,
    retrace,
    smooth,
)
from homsense.expectation import HOPS
from homsense.kriging import MOST_COUNTED
from homsense.registered.registration import COMPASS_RAD
from homsense_cli.accuracy.scenario import Scenario

CELL_M = 2.0
WEAKEST_DBM = -95.0


@dataclass(frozen=True)
class RegisteredCrowd:
    """A crowd that has found its place on the map.

    Parameters
    ----------
    scans : list of WalkScan
        All of it.
    registered : RegisteredComplex
        As many of them as are of use, with places.
    likelihood : PlaceLikelihood
        Of a scan, over the map.
    """

    scans: list[WalkScan]
    registered: RegisteredComplex
    likelihood: PlaceLikelihood

    @classmethod
    def of(
        cls,
        scans: Iterable[WalkScan],
        site_map: SiteMap,
        ground: FreeSpace,
        reachable: FreeSpace,
        hearing: Hearing | None = None,
    ) -> "RegisteredCrowd | None":
        """Return the crowd of some scans.

        Parameters
        ----------
        scans : iterable of WalkScan
            The crowd, which knows east.
        site_map : SiteMap
            The map.
        ground : FreeSpace
            Where the map says that one can be.
        reachable : FreeSpace
            Where devices are looked for.
        hearing : Hearing, optional
            What of a scan counts.

        Returns
        -------
        RegisteredCrowd or None
            Placed without any label; None when it finds no place.
        """
        everything = list(scans)
        try:
            found = register_crowd(
                everything, ground, hearing=hearing, rotation_sd_rad=COMPASS_RAD
            )
        except InvalidInputError:
            return None
        smoothed = smooth(found, everything, site_map, reachable).thinned()
        return cls(everything, smoothed, PlaceLikelihood(smoothed, reachable))

    @property
    def is_sure(self) -> bool:
        """Whether its place is beyond doubt."""
        return not self.registered.registration.is_doubtful

    @cached_property
    def been(self) -> Retraced:
        """Where it has been, also while it heard too little."""
        return retrace(self.registered, self.scans)

    def counted(self, profiles: Profiles, seen: Sequence[frozenset[str]]) -> Counted:
        """Return what the crowd counts at its places.

        Parameters
        ----------
        profiles : Profiles
            Holes near each landmark.
        seen : sequence of frozenset of str
            What each of its scans has in view.

        Returns
        -------
        Counted
            Of some of them.
        """
        some = self.been.stretches(MOST_COUNTED)
        made = self.been.source[some].tolist()
        walks = [self.scans[number].walk for number in made]
        return Counted.of(walks, self.been.xy[some], [seen[number] for number in made], profiles)


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
    """

    site_map: SiteMap
    free_space: FreeSpace
    grown: LandmarkComplex
    profiles: Profiles
    radio: RadioModel
    expectation: Expectation
    noise: FieldNoise
    crowd: RegisteredCrowd | None = None

    @classmethod
    def of(
        cls,
        site_map: SiteMap,
        free_space: FreeSpace,
        crowd: Iterable[frozenset[str]],
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
        crowd : iterable of frozenset of str
            What each scan has heard.
        model : Tuned
            What the site has learnt.
        registered : RegisteredCrowd, optional
            The same crowd on the map.

        Returns
        -------
        Scene
            Ready for robots.
        """
        heard_by = list(crowd)
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
        return cls(
            site_map, free_space, grown, profiles, model.radio, expectation, noise, registered
        )

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
    return CityScene(scenario, world, Scene.of(site_map, free_space, crowd, model, placed))


def walk_scan(scan: Mapping[str, Any]) -> WalkScan:
    """Return a scan as the service takes it as one of a walk.

    Parameters
    ----------
    scan : mapping
        With ``track``.

    Returns
    -------
    WalkScan
        The same.
    """
    track = scan["track"]
    return WalkScan(
        f"{scan['device']} {track['id']}",
        scan["observed_at"],
        track["x_m"],
        track["y_m"],
        heard(scan["landmarks"]),
    )


def heard(landmarks: Iterable[Mapping[str, Any]]) -> tuple[Reading, ...]:
    """Return readings that are written as the service takes them."""
    return tuple(
        Reading(entry["id"], entry["rssi"], entry.get("age_s", 0.0)) for entry in landmarks
    )
