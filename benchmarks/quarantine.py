"""How many moved transmitters are found, how many others are accused, what the counts gain.

One half of a crowd walks a town before some transmitters move, the other half afterwards. A
transmitter that moves takes a place beside another one, far from its own.
"""

from dataclasses import replace
from itertools import chain, product

import numpy as np
from homsense_fleet.device import phone_scans
from homsense_fleet.world import World, city_world
from load import seeded

from homsense import LandmarkComplex, displaced

SEEDS, SCANS_EACH = range(5), 130
STYLES, PHONES, SHARES = ("downtown-44", "old-town", "campus"), (10, 40), (0.0, 0.01, 0.05, 0.1)
LEAST_M = 200.0


def table() -> list[str]:
    """Return rates and hole counts by the size of the crowd and how many have moved."""
    rows = [
        (
            f"Towns of seeds {SEEDS[0]} to {SEEDS[-1]}, 197 transmitters, {SCANS_EACH} scans a "
            "phone; half of the phones walk before the move, half after it; moves of "
            f"{LEAST_M:.0f} m and more. Means."
        ),
        "",
        (
            "| town | phones | moved | of these in quarantine | others in quarantine "
            "| holes without the move | with it | and with the quarantine |"
        ),
        "|---|---|---|---|---|---|---|---|",
    ]
    for style in STYLES:
        for phones, share in product(PHONES, SHARES):
            runs = np.array([_run(style, seed, phones, share) for seed in SEEDS])
            found, accused, *holes = runs.mean(axis=0)
            caught = f"{found:.0%}" if share else ""
            counts = " | ".join(f"{count:.1f}" for count in holes)
            rows.append(
                f"| {style} | {phones} | {share:.0%} | {caught} | {accused:.1%} | {counts} |"
            )
    return rows


def _run(style: str, seed: int, phones: int, share: float) -> tuple[float, ...]:
    before = city_world(style, seed)
    moved, after = _moved(before, share, seeded(seed, 9))
    walks = [_walk(before, seed, n) for n in range(phones)]
    calm = list(chain.from_iterable(walks))
    walks[1::2] = [_walk(after, seed, n) for n in range(1, phones, 2)]
    mixed = list(chain.from_iterable(walks))
    grown = LandmarkComplex.from_observations(mixed)
    accused = {one.landmark for one in displaced(grown)}
    rest = LandmarkComplex.from_observations(left for scan in mixed if (left := scan - accused))
    return (
        len(accused & moved) / max(1, len(moved)),
        len(accused - moved) / (len(before.ids) - len(moved)),
        *(k.betti_numbers()[1] for k in (LandmarkComplex.from_observations(calm), grown, rest)),
    )


def _moved(world: World, share: float, rng: np.random.Generator) -> tuple[set[str], World]:
    """Return who moves, and the world afterwards."""
    count = round(share * len(world.ids))
    places = world.transmitters.copy()
    chosen = rng.choice(len(places), count, replace=False)
    for number in chosen:
        far = np.hypot(*(world.transmitters - world.transmitters[number]).T) >= LEAST_M
        places[number] = world.transmitters[rng.choice(np.flatnonzero(far))] + (0.5, 0.5)
    return {world.ids[number] for number in chosen}, replace(world, transmitters=places)


def _walk(world: World, seed: int, phone: int) -> list[frozenset[str]]:
    rng = seeded(seed, phone)
    return [
        frozenset(entry["id"] for entry in scan["landmarks"])
        for scan in phone_scans(world, str(phone), rng, count=SCANS_EACH)
        if scan["landmarks"]
    ]


if __name__ == "__main__":
    print("\n".join(table()))
