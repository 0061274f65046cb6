"""The scans of a crowd: by device, as walks, and with a place on the map."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from homsense import (
    Counted,
    FreeSpace,
    Hearing,
    InvalidInputError,
    Profiles,
    RadioMapLikelihood,
    Reading,
    RegisteredComplex,
    Retraced,
    SiteMap,
    WalkScan,
    register_crowd,
    retrace,
    smooth,
)
from homsense.kriging import MOST_COUNTED
from homsense.registered.registration import COMPASS_RAD


@dataclass(frozen=True)
class RegisteredCrowd:
    """A crowd that has found its place on the map.

    Parameters
    ----------
    scans : list of WalkScan
        All of it.
    registered : RegisteredComplex
        As many of them as are of use, with places.
    likelihood : RadioMapLikelihood
        Of a scan, over the map.
    """

    scans: list[WalkScan]
    registered: RegisteredComplex
    likelihood: RadioMapLikelihood

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
        return cls(everything, smoothed, RadioMapLikelihood(smoothed, reachable))

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


def by_device(crowd: Iterable[tuple[str, frozenset[str]]]) -> list[list[frozenset[str]]]:
    """Return what each device has heard, scan by scan."""
    walks: dict[str, list[frozenset[str]]] = {}
    for device, seen in crowd:
        walks.setdefault(device, []).append(seen)
    return [*walks.values()]


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
