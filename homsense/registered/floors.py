"""Which floor a crowd walks on: the same layout placed on the map of each."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from homsense.errors import InvalidInputError
from homsense.free_space import FreeSpace
from homsense.registered.complex import RegisteredComplex
from homsense.registered.crowd import WalkScan
from homsense.registered.matching import probabilities
from homsense.registered.placing import TOO_LARGE, LaidOutCrowd
from homsense.registered.similarity import Hearing


class FloorFit(NamedTuple):
    """How well a crowd fits one of several floors.

    Parameters
    ----------
    name : str
        The floor.
    probability : float
        That it is this one of them; see `homsense.registered.matching.probabilities`.
    complex : RegisteredComplex
        The crowd on its map.
    """

    name: str
    probability: float
    complex: RegisteredComplex


def rank_floors(
    scans: Iterable[WalkScan],
    floors: Mapping[str, FreeSpace],
    *,
    hearing: Hearing | None = None,
    rotation_sd_rad: float | None = None,
) -> list[FloorFit]:
    """Place a crowd on each of several maps.

    Parameters
    ----------
    scans : iterable of WalkScan
        The crowd, all of one floor.
    floors : mapping of str to FreeSpace
        The candidates.
    hearing : Hearing, optional
        What of a scan counts.
    rotation_sd_rad : float, optional
        How far the headings of the crowd are from those of the maps, radians; unknown when absent.

    Returns
    -------
    list of FloorFit
        The likeliest first, without those that the crowd is far too large for. Each has its own
        margin and mirror margin, so a crowd that belongs to none of the floors can be told from
        one that does.

    Raises
    ------
    InvalidInputError
        If there is no candidate, or the crowd is too small to be laid out, or too large for all.
    """
    if not floors:
        message = "there must be at least one map"
        raise InvalidInputError(message, "floors")
    crowd = LaidOutCrowd.of(scans, hearing)
    placed = {
        name: crowd.on(ground, rotation_sd_rad)
        for name, ground in floors.items()
        if crowd.fits(ground)
    }
    if not placed:
        raise InvalidInputError(TOO_LARGE, "scans")
    ranked = sorted(placed.items(), key=lambda entry: entry[1].registration.cost_m)
    shares = probabilities([found.registration.cost_m for _, found in ranked]).tolist()
    return [
        FloorFit(name, share, found) for (name, found), share in zip(ranked, shares, strict=True)
    ]
