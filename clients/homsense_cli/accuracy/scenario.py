"""What can be varied: the world, its crowd, and how well a robot knows its own motion."""

from dataclasses import dataclass
from pathlib import Path

from homsense_fleet.styles import STYLES
from homsense_fleet.world import Radio, World, city_world, world_from_geojson

from homsense_cli.maps import read_map

STEP_M = 5.0
STEP_S = 1.0
PAPER_LINEAR, PAPER_ANGULAR = 10.0, 0.435


@dataclass(frozen=True, slots=True)
class Imu:
    """Quality of own motion: deviations for a step of 5 m, which lasts a second.

    Parameters
    ----------
    name : str
        For people.
    translation_m : float
        Along each body axis, metres.
    rotation_rad : float
        Of the turn, radians.
    """

    name: str
    translation_m: float
    rotation_rad: float


IMUS = {
    imu.name: imu
    for imu in (
        Imu("good", 0.25, 0.02),
        Imu("moderate", 0.8, 0.05),
        Imu("heavy", 2.0, 0.15),
        Imu("paper", PAPER_LINEAR * STEP_S**2 / 2.0, PAPER_ANGULAR * STEP_S**2 / 2.0),
    )
}


@dataclass(frozen=True, slots=True)
class Scenario:
    """Which world, and who maps it.

    Parameters
    ----------
    city : str
        A style of generated city, or a map file.
    seed : int
        Decides city, transmitters, crowd and robots.
    transmitters : int
        How many there are.
    s_max_m : float
        How far they are heard, metres.
    dropout : float
        Share of transmitters in view that a scan misses.
    phones, scans_each : int
        The crowd.
    window_m : float, optional
        Side of the busiest window of a map of footprints, metres.
    scale : float
        Of a generated city: the size of its buildings and streets, to the usual one.
    """

    city: str = "downtown-44"
    seed: int = 0
    transmitters: int = 197
    s_max_m: float = 72.0
    dropout: float = 0.05
    phones: int = 40
    scans_each: int = 130
    window_m: float | None = None
    scale: float = 1.0

    @property
    def name(self) -> str:
        """City and seed."""
        return f"{Path(self.city).name.split('.')[0]} {self.seed}"

    def world(self) -> World:
        """Return the world."""
        radio = Radio(s_max_m=self.s_max_m, dropout=self.dropout)
        if self.city in STYLES:
            return city_world(
                self.city,
                self.seed,
                n_transmitters=self.transmitters,
                radio=radio,
                scale=self.scale,
            )
        return world_from_geojson(
            read_map(Path(self.city), self.window_m),
            self.seed,
            n_transmitters=self.transmitters,
            radio=radio,
            name=self.name,
        )


def check_city(name: str) -> None:
    """Raise ValueError unless a city is a known style or a file."""
    if name not in STYLES and not Path(name).is_file():
        message = f"--city must be one of {', '.join(STYLES)} or a map file, not {name!r}"
        raise ValueError(message)
