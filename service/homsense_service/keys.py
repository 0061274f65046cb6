"""API keys: who calls, what for, and where."""

import hashlib
import hmac
import secrets
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from homsense_service.errors import ForbiddenError, UnauthorizedError
from homsense_service.records import KeyRecord

Scope = Literal["admin", "ingest", "localize", "read"]
SCOPES: tuple[Scope, ...] = get_args(Scope)
PREFIX = "homsense_"
_BYTES = 32


@dataclass(frozen=True, slots=True)
class Caller:
    """Whoever has sent a request.

    Parameters
    ----------
    name : str
        Of the key.
    scopes : frozenset of str
        What it is good for; `admin` is good for everything.
    sites : frozenset of str, optional
        Where; everywhere when absent.
    """

    name: str
    scopes: frozenset[str]
    sites: frozenset[str] | None = None

    def sees(self, site: str) -> bool:
        """Tell whether a site exists for this caller."""
        return self.sites is None or site in self.sites

    def check(self, scope: Scope) -> None:
        """Raise `ForbiddenError` unless the key is good for something."""
        if scope not in self.scopes and "admin" not in self.scopes:
            message = f"this needs a key with the scope {scope}"
            raise ForbiddenError(message)

    def check_everywhere(self) -> None:
        """Raise `ForbiddenError` when the key is bound to sites."""
        if self.sites is not None:
            message = "this needs a key that is not bound to sites"
            raise ForbiddenError(message)


ANYBODY = Caller("anybody", frozenset(SCOPES))


class KeyRing:
    """The keys that are good now; without any, everybody may do everything.

    Parameters
    ----------
    records : iterable of KeyRecord
        From the store.
    """

    def __init__(self, records: Iterable[KeyRecord]) -> None:
        self.replace(records)

    def __len__(self) -> int:
        return len(self._records)

    def replace(self, records: Iterable[KeyRecord]) -> None:
        """Take other keys from now on."""
        self._records = {record.name: record for record in records}

    def has(self, name: str) -> bool:
        """Tell whether a key by which somebody came in is still good."""
        return not self._records or name in self._records

    def caller(self, token: str | None) -> Caller:
        """Return who has a token.

        Parameters
        ----------
        token : str, optional
            As it was sent.

        Returns
        -------
        Caller
            All tokens are compared, each in the same time.

        Raises
        ------
        UnauthorizedError
            If there are keys and it is none of them.
        """
        if not self._records:
            return ANYBODY
        if token is None:
            message = "there is no key; send it as `Authorization: Bearer KEY`"
            raise UnauthorizedError(message)
        hashed, found = hash_of(token), None
        for record in self._records.values():
            if hmac.compare_digest(record.hashed, hashed):
                found = record
        if found is None:
            message = "the key is not known"
            raise UnauthorizedError(message)
        sites = None if found.sites is None else frozenset(found.sites)
        return Caller(found.name, frozenset(found.scopes), sites)


def new_key(
    name: str, scopes: Sequence[str], sites: Sequence[str] | None, now_s: float
) -> tuple[str, KeyRecord]:
    """Return a new key and what is kept of it.

    Parameters
    ----------
    name : str
        For people.
    scopes : sequence of str
        Some of `SCOPES`.
    sites : sequence of str, optional
        Where it is good; everywhere when absent.
    now_s : float
        Unix seconds.

    Returns
    -------
    token : str
        The key itself, which is told once.
    record : KeyRecord
        For the store.

    Raises
    ------
    ValueError
        If a scope is not known.
    """
    unknown = sorted({*scopes} - {*SCOPES})
    if unknown or not scopes:
        message = f"scope: one or more of {', '.join(SCOPES)}, not {', '.join(unknown) or 'none'}"
        raise ValueError(message)
    token = PREFIX + secrets.token_urlsafe(_BYTES)
    of_sites = None if not sites else tuple(sorted({*sites}))
    return token, KeyRecord(name, hash_of(token), tuple(sorted({*scopes})), of_sites, now_s)


def hash_of(token: str) -> bytes:
    """Return what is kept of a key; keys are random, so a fast hash is enough."""
    return hashlib.sha256(token.encode()).digest()
