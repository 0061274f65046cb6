"""What a site is at one moment: its map, and what its scans say."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple, Self

import homsense
from homsense.range_check import quick_euler
from homsense.skeleton import n_edges
from homsense_service.names import Names


class Counts(NamedTuple):
    """What a complex amounts to; what is sensed but for `raw_betti`."""

    digest: str
    landmarks: int
    facets: int
    edges: int
    betti: tuple[int, ...]
    euler: int | None
    raw_betti: tuple[int, ...]


@dataclass(frozen=True)
class MapVersion:
    """One version of a site's map with what localization needs of it.

    Parameters
    ----------
    document : dict
        GeoJSON as it was put.
    site_map : homsense.SiteMap
        The map itself.
    free_space : homsense.FreeSpace
        Its free cells.
    digest : str
        Content hash: the version.
    origin : tuple of float, optional
        Georeference that was given beside the document.
    """

    document: dict[str, Any]
    site_map: homsense.SiteMap
    free_space: homsense.FreeSpace
    digest: str
    origin: tuple[float, float] | None = None

    @classmethod
    def read(
        cls, document: dict[str, Any], origin: tuple[float, float] | None, cell_m: float
    ) -> Self:
        """Return the version that a document describes."""
        site_map = homsense.SiteMap.from_geojson(document, origin=origin)
        free_space = homsense.FreeSpace.of(site_map, cell_m)
        return cls(document, site_map, free_space, site_map.digest(), origin)


@dataclass(frozen=True)
class ComplexVersion:
    """One version of a site's complex.

    Parameters
    ----------
    epochs : homsense.EpochFiltration
        The complexes by epochs and witnesses; as many levels as the quorum.
    number : int
        Scans in the log when it was reached; grows with every scan.
    devices : Names
        Who contributed.
    generation : int
        Changes whenever the complex itself does; names what is derived from it.
    suspects : Names, optional
        Landmarks that may have moved, or come back, since `before`; all when absent.
    before : tuple of homsense.Displaced
        The quarantine when it was last looked at.
    """

    epochs: homsense.EpochFiltration
    number: int
    devices: Names
    generation: int
    suspects: Names | None = field(default_factory=Names)
    before: tuple[homsense.Displaced, ...] = ()

    @cached_property
    def quarantine(self) -> tuple[homsense.Displaced, ...]:
        """Transmitters that seem to have moved; they are not sensed. Looked for when asked for."""
        if self.suspects is None:
            return tuple(homsense.displaced(self.landmark_complex))
        if not self.suspects:
            return self.before
        looked_at = frozenset(self.suspects).union(found.landmark for found in self.before)
        return tuple(homsense.displaced(self.landmark_complex, looked_at))

    @property
    def doubts(self) -> tuple[Names | None, tuple[homsense.Displaced, ...]]:
        """What is still to be looked at, and the quarantine before that: for the next version."""
        if "quarantine" in self.__dict__:
            return Names(), self.quarantine
        return self.suspects, self.before

    @property
    def filtration(self) -> homsense.WitnessFiltration:
        """The complexes by witnesses, of all epochs that count."""
        return self.epochs.merged

    @property
    def landmark_complex(self) -> homsense.LandmarkComplex:
        """What a quorum of devices has seen, quarantined transmitters among it."""
        return self.filtration.level(self.filtration.depth)

    @property
    def left_out(self) -> frozenset[str]:
        """The quarantined transmitters."""
        return frozenset(found.landmark for found in self.quarantine)

    @property
    def sensed(self) -> homsense.LandmarkComplex:
        """What a quorum of devices has seen, without quarantined transmitters."""
        everything = self.landmark_complex
        if not self.quarantine:
            return everything
        return everything.induced(everything.landmarks - self.left_out)

    @property
    def raw(self) -> homsense.LandmarkComplex:
        """The complex of all that any device has seen."""
        return self.filtration.level(1)

    @cached_property
    def counts(self) -> Counts:
        """What it amounts to; counted when asked for."""
        grown = self.sensed
        return Counts(
            grown.digest(),
            grown.n_landmarks,
            grown.n_facets,
            n_edges(grown),
            grown.betti_numbers(),
            quick_euler(grown),
            self.raw.betti_numbers(),
        )


@dataclass(frozen=True)
class WitnessCheck:
    """What the complex would be if more devices had to agree.

    Parameters
    ----------
    median_witnesses : float
        Distinct devices that have seen a landmark, in the median.
    points : list of homsense.WitnessPoint
        One for each number of witnesses.
    """

    median_witnesses: float
    points: list[homsense.WitnessPoint]
