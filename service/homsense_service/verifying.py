"""Whether a store holds what it promised: all is built again from the logs and compared."""

from collections.abc import Iterator
from typing import NamedTuple

from homsense import HomsenseError
from homsense_service.errors import ServiceError
from homsense_service.operations import Operations
from homsense_service.store import Store


class Verified(NamedTuple):
    """One thing that was looked at.

    Parameters
    ----------
    what : str
        A site or a session.
    is_sound : bool
        Whether all digests are equal.
    told : str
        What was found.
    """

    what: str
    is_sound: bool
    told: str


def verified(store: Store, operations: Operations) -> Iterator[Verified]:
    """Yield what was found of the file, of each site and of each session.

    Parameters
    ----------
    store : Store
        The store.
    operations : Operations
        A service on it that nobody else uses.

    Yields
    ------
    Verified
        One for each.
    """
    damage = store.damage()
    yield Verified("file", not damage, "; ".join(damage) or "every page and index is sound")
    for site in operations.sites.all():
        resumed = site.complex.landmark_complex.digest(), site.complex.number
        operations.sites.rebuild(site)
        built = site.complex.landmark_complex.digest(), site.complex.number
        told = f"{built[1]} scans, digest {built[0][:16]}"
        may_shrink = site.config.retention is not None
        is_sound = built == resumed or (may_shrink and built[0] == resumed[0])
        if not is_sound:
            told = (
                f"the checkpoint has {resumed[1]} scans and digest {resumed[0][:16]}, the log "
                f"{built[1]} and {built[0][:16]}"
            )
        yield Verified(f"site {site.name}", is_sound, told)
    for name in operations.sessions.names():
        yield _session(operations, name)


def _session(operations: Operations, name: str) -> Verified:
    what = f"session {name}"
    try:
        session = operations.sessions.get(name)
        resumed, replayed = session.fix, session.replayed_from_start().fix
    except (ServiceError, HomsenseError) as error:
        return Verified(what, is_sound=False, told=str(error))
    same = (resumed.seq, resumed.digest) == (replayed.seq, replayed.digest)
    told = f"{replayed.seq} steps, digest {replayed.digest}"
    if not same:
        told = f"from a snapshot {resumed.digest}, from the start {replayed.digest}"
    return Verified(what, same, told)
