"""How the crowd of a site lies on its map, on the wire."""

from typing import Annotated, Literal

from pydantic import Field

from homsense_service.schemas.wire import NAME, Wire


class PlacementOut(Wire):
    """One way to lay the crowd on the map."""

    rotation_rad: float = Field(description="From the headings of the crowd to those of the map.")
    scale: float = Field(description="Of the lengths of the layout.")
    cost_m: float = Field(
        description="Mean distance from the scans to the ground and from the ground to the scans, "
        "both bounded, and what rotation and scale are unlikely by."
    )
    probability: float = Field(description="That it is this one of the placements.")


class FitOut(Wire):
    """How well a crowd fits a map."""

    cost_m: float
    margin_m: float = Field(description="How much worse the next placement is, metres.")
    mirror_margin_m: float = Field(
        description="How much worse the mirror image of the crowd fits, metres: a control."
    )
    strain: float = Field(
        description="How bent the crowd lies: what steps, likeness and ground leave of one "
        "another, squares of deviations a scan; more than 0.6 is doubtful."
    )
    doubtful: bool = Field(
        description="Whether another placement is nearly as good, or the mirror image is, as on a "
        "wrong map, or the crowd has to bend too much."
    )


class PlacedOut(FitOut):
    """The crowd on the map."""

    map_version: str
    tracked: int = Field(description="Scans with tracks that there were.")
    laid_out: int = Field(
        description="Those when the crowd was last laid out as a whole; the others have joined it."
    )
    scans: int = Field(description="Those that have a place.")
    walks: int
    reach_m: float = Field(description="Distance over which scans hear alike, metres.")
    weakest_dbm: float = Field(description="Weakest strength that counted.")
    coverage: float = Field(description="Share of the map where the crowd has been.")
    information_bits: float = Field(
        description="What a scan tells about its place, judged by walks that are left out."
    )
    placements: list[PlacementOut]


class FloorsIn(Wire):
    """Whose maps a crowd may lie on."""

    sites: list[Annotated[str, Field(pattern=NAME)]] = Field(
        min_length=1, max_length=32, description="Names of sites with maps, its own among them."
    )


class FloorOut(FitOut):
    """How well a crowd fits one of several floors."""

    site: str
    map_version: str
    probability: float = Field(description="That it is this one of them.")


class FloorsOut(Wire):
    """How far a ranking of floors is, and what the last one has told."""

    state: Literal["none", "building", "ready", "failed"]
    done: int = Field(description="Stages that have been reached.")
    of: int
    reason: str | None = Field(description="Why it failed.")
    floors: list[FloorOut] = Field(description="The likeliest first.")


class RegistrationOut(Wire):
    """How far the registration of a crowd is, and where the last one lies."""

    state: Literal["none", "building", "ready", "failed"]
    done: int = Field(description="Stages that have been reached.")
    of: int
    reason: str | None = Field(description="Why it failed.")
    tracked: int = Field(description="Scans with tracks that there are now.")
    placed: PlacedOut | None
