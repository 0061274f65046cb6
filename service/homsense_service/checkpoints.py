"""What a site has made of its scans, as bytes: a start reads this and the end of the log."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import count
from typing import Any

from numpy.typing import NDArray

import homsense
from homsense.engine import Engine
from homsense.facet_table import Ragged
from homsense.plain import PlainComplex, PlainFiltration, from_plain, to_plain
from homsense_service.bundles import bundled, unbundled
from homsense_service.names import Names
from homsense_service.records import SiteConfig
from homsense_service.versions import ComplexVersion

FORM = 1


@dataclass(frozen=True)
class Digested:
    """All that a site has made of its scans.

    Parameters
    ----------
    complex : ComplexVersion
        The complexes.
    sample : mapping of bytes to frozenset of str
        Visible sets of scans from all over the site.
    tracked : int
        Scans with tracks.
    """

    complex: ComplexVersion
    sample: Mapping[bytes, frozenset[str]]
    tracked: int


def sensing(config: SiteConfig) -> tuple[object, ...]:
    """Return what of a configuration decides what scans are made into."""
    return (
        config.landmark_key,
        config.min_rssi_dbm,
        config.max_age_s,
        config.quorum,
        config.quarantine,
        config.retention,
    )


def checkpoint_key(config: SiteConfig, sample_size: int) -> str:
    """Return what a checkpoint is good for."""
    return json.dumps([FORM, sample_size, *sensing(config)])


def to_bytes(digested: Digested) -> bytes:
    """Return the body of a checkpoint."""
    version, arrays, numbers = digested.complex, dict[str, NDArray[Any]](), count()

    def kept(parts: tuple[PlainComplex, ...]) -> list[dict[str, Any]]:
        entries = []
        for part in parts:
            number = next(numbers)
            arrays[f"ends_{number}"] = part.facets.ends
            arrays[f"values_{number}"] = part.facets.values
            entries.append({"number": number, "landmarks": part.landmarks})
        return entries

    plain = to_plain(version.epochs)
    suspects, quarantine = version.doubts
    document = {
        "epochs": {str(epoch): kept(parts) for epoch, parts in plain.epochs.items()},
        "merged": None if len(plain.epochs) == 1 else kept(plain.merged),
        "number": version.number,
        "devices": sorted(version.devices),
        "suspects": None if suspects is None else sorted(suspects),
        "quarantine": [
            [found.landmark, found.hops_apart, found.here, found.there] for found in quarantine
        ],
        "sample": [[key.hex(), sorted(seen)] for key, seen in digested.sample.items()],
        "tracked": digested.tracked,
    }
    return bundled(document, arrays)


def from_bytes(body: bytes, generation: int, engine: Engine) -> Digested:
    """Return what a checkpoint holds."""
    document, arrays = unbundled(body)

    def parts(entries: list[dict[str, Any]]) -> Iterator[PlainComplex]:
        for entry in entries:
            number = entry["number"]
            facets = Ragged(arrays[f"ends_{number}"], arrays[f"values_{number}"])
            yield PlainComplex(entry["landmarks"], facets)

    epochs = {int(epoch): tuple(parts(entries)) for epoch, entries in document["epochs"].items()}
    merged = document["merged"]
    plain = PlainFiltration(
        epochs, next(iter(epochs.values())) if merged is None else tuple(parts(merged))
    )
    version = ComplexVersion(
        from_plain(plain, engine),
        document["number"],
        Names().joined_by(document["devices"]),
        generation,
        None if document["suspects"] is None else Names().joined_by(document["suspects"]),
        tuple(
            homsense.Displaced(landmark, apart, tuple(here), tuple(there))
            for landmark, apart, here, there in document["quarantine"]
        ),
    )
    sample = {bytes.fromhex(key): frozenset(seen) for key, seen in document["sample"]}
    return Digested(version, sample, document["tracked"])
