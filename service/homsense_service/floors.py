"""Which floor the crowd of a site walks on: placed on several maps in the background."""

from collections.abc import Callable
from dataclasses import dataclass

import homsense
from homsense_service.background import Background, Builder, Words
from homsense_service.errors import RegistrationFailedError, RegistrationPendingError
from homsense_service.registering import HEARINGS, CrowdQuestion, of_each_hearing
from homsense_service.versions import MapVersion

_WORDS = Words(
    "the crowd is being placed on the maps",
    "the crowd cannot be placed on the maps",
    len(HEARINGS),
    RegistrationPendingError,
    RegistrationFailedError,
)


@dataclass(frozen=True)
class FloorsQuestion:
    """What a ranking of floors depends on.

    Parameters
    ----------
    crowd : CrowdQuestion
        The crowd, and the map of its own site.
    maps : dict of str to MapVersion
        The candidates, by site.
    """

    crowd: CrowdQuestion
    maps: dict[str, MapVersion]

    @property
    def map_version(self) -> MapVersion:
        """The map of its own site."""
        return self.crowd.map_version

    @property
    def scans(self) -> int:
        """How many scans of the crowd have tracks."""
        return self.crowd.scans

    @property
    def conditions(self) -> tuple[object, ...]:
        """How the crowd is understood, and the candidates."""
        maps = ((name, version.digest) for name, version in self.maps.items())
        return *self.crowd.conditions, *maps


@dataclass(frozen=True)
class RankedFloors:
    """How well a crowd fits each of several floors.

    Parameters
    ----------
    map_digest : str
        The map of its own site.
    maps : dict of str to MapVersion
        The candidates, by site.
    fits : tuple of homsense.FloorFit
        The likeliest first.
    """

    map_digest: str
    maps: dict[str, MapVersion]
    fits: tuple[homsense.FloorFit, ...]


class RankingFloors(Background[FloorsQuestion, RankedFloors]):
    """The ranking for the crowd of one site.

    Parameters
    ----------
    builder : Builder
        Does the work.
    """

    def __init__(self, builder: Builder) -> None:
        super().__init__(builder, _WORDS)

    def _build(self, question: FloorsQuestion, on_step: Callable[[int], None]) -> RankedFloors:
        crowd, scans = question.crowd, list(question.crowd.walks())
        grounds = {name: version.free_space for name, version in question.maps.items()}

        def ranked(number: int, hearing: homsense.Hearing) -> list[homsense.FloorFit]:
            fits = homsense.rank_floors(
                scans, grounds, hearing=hearing, rotation_sd_rad=crowd.rotation_sd_rad
            )
            on_step(number + 1)
            return fits

        best = min(of_each_hearing(ranked), key=lambda fits: fits[0].complex.registration.cost_m)
        return RankedFloors(question.map_version.digest, question.maps, tuple(best))
