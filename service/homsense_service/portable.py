"""One site as one file: a line for the site, one for its map, one for each scan, and a seal.

The lines are JSON, gzipped. The seal is the hash of all lines before it, so a file that was cut
off or changed is refused as a whole. The same site always gives the same bytes.
"""

import hashlib
import json
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from itertools import islice
from typing import Any

from homsense_service.errors import PortableError, SiteExistsError
from homsense_service.records import SiteRecord, StoredReading, StoredScan, config_of
from homsense_service.store import Store

FORMAT, VERSION = "homsense-site", 1
_CHUNK = 1000
_GZIP = 16 + zlib.MAX_WBITS


def exported(store: Store, site: str) -> Iterator[bytes]:
    """Yield the file of a site, piece by piece.

    Parameters
    ----------
    store : Store
        Has the site.
    site : str
        Its name.

    Yields
    ------
    bytes
        To be written one after the other.
    """
    packing = zlib.compressobj(wbits=_GZIP)
    seal = hashlib.sha256()
    for line in _lines(store, site):
        text = _text(line)
        seal.update(text)
        if piece := packing.compress(text):
            yield piece
    yield packing.compress(_text({"sha256": seal.hexdigest()})) + packing.flush()


def check(pieces: Iterable[bytes]) -> str:
    """Return the name of the site of a file, once all of it is known to be sound.

    Parameters
    ----------
    pieces : iterable of bytes
        The file.

    Returns
    -------
    str
        Name of the site.

    Raises
    ------
    PortableError
        If it is no such file, or not all of it.
    """
    seal, name, sealed = hashlib.sha256(), None, None
    for number, (text, line) in enumerate(_unpacked(pieces), start=1):
        if sealed is not None:
            message = f"line {number} lies behind the seal"
            raise PortableError(message)
        if name is None:
            if line.get("format") != FORMAT or line.get("version") != VERSION:
                message = f"it is no file of the format {FORMAT} {VERSION}"
                raise PortableError(message)
            name = str(line["site"])
        if "sha256" in line:
            sealed = line["sha256"]
        else:
            seal.update(text)
    if name is None or sealed != seal.hexdigest():
        message = "it was cut off or changed: the seal does not match"
        raise PortableError(message)
    return name


def imported(store: Store, pieces: Iterable[bytes], site: str) -> int:
    """Make a site from a file that has been checked, and return how many scans it has.

    Parameters
    ----------
    store : Store
        Where to.
    pieces : iterable of bytes
        The file.
    site : str
        Name of the new site.

    Returns
    -------
    int
        Number of scans.

    Raises
    ------
    SiteExistsError
        If there is a site of this name.
    """
    if site in store.sites():
        message = f"there is a site {site!r} already"
        raise SiteExistsError(message)
    try:
        return _imported(store, (line for _, line in _unpacked(pieces)), site)
    except BaseException:
        if site in store.sites():
            store.delete_site(site)
        raise


def _imported(store: Store, lines: Iterator[dict[str, Any]], site: str) -> int:
    head = next(lines)
    store.put_site(site, SiteRecord(config_of(head["config"])))
    count = 0
    while chunk := list(islice(lines, _CHUNK)):
        for line in chunk:
            if "map" in line:
                store.put_map(site, line["map"], 1)
        scans = [_scan(line["scan"]) for line in chunk if "scan" in line]
        store.add_scans(site, scans, lambda _: None)
        count += len(scans)
    return count


def _lines(store: Store, site: str) -> Iterator[dict[str, Any]]:
    config = asdict(store.sites()[site].config)
    yield {"format": FORMAT, "version": VERSION, "site": site, "config": config}
    document = store.map_document(site)
    if document is not None:
        yield {"map": document}
    for _, scan in store.scans(site):
        heard = [(r.landmark, r.rssi_dbm, r.age_s) for r in scan.readings]
        yield {"scan": [scan.device, scan.scan_id, scan.observed_at, heard, scan.track]}


def _scan(fields: list[Any]) -> StoredScan:
    device, scan_id, observed_at, heard, track = fields
    readings = tuple(StoredReading(*reading) for reading in heard)
    return StoredScan(device, scan_id, observed_at, readings, track)


def _text(line: dict[str, Any]) -> bytes:
    return json.dumps(line, separators=(",", ":")).encode() + b"\n"


def _unpacked(pieces: Iterable[bytes]) -> Iterator[tuple[bytes, dict[str, Any]]]:
    unpacking, rest = zlib.decompressobj(wbits=_GZIP), b""
    try:
        for piece in pieces:
            *texts, rest = (rest + unpacking.decompress(piece)).split(b"\n")
            for text in texts:
                yield text + b"\n", json.loads(text)
    except (zlib.error, ValueError) as error:
        message = f"it cannot be read: {error}"
        raise PortableError(message) from error
