"""API keys on the wire."""

from typing import Annotated, Self

from pydantic import Field, StringConstraints

from homsense_service.keys import Scope
from homsense_service.records import KeyRecord
from homsense_service.schemas.wire import NAME, Wire

KeyName = Annotated[str, StringConstraints(pattern=NAME)]
SiteName = Annotated[str, StringConstraints(pattern=NAME)]


class KeyIn(Wire):
    """A key to be made."""

    name: KeyName
    scopes: list[Scope] = Field(
        min_length=1,
        max_length=4,
        description="ingest: post scans. localize: sessions. read: everything else that changes "
        "nothing. admin: all.",
    )
    sites: list[SiteName] | None = Field(
        default=None, min_length=1, max_length=1000, description="Everywhere when absent."
    )


class KeyOut(Wire):
    """A key, without the key itself."""

    name: str
    scopes: list[str]
    sites: list[str] | None
    created_at: float = Field(description="Unix seconds.")

    @classmethod
    def of(cls, record: KeyRecord) -> Self:
        """Return the wire form of a stored value."""
        return cls(
            name=record.name,
            scopes=list(record.scopes),
            sites=None if record.sites is None else list(record.sites),
            created_at=record.created_at_s,
        )


class NewKeyOut(KeyOut):
    """A key that has just been made."""

    key: str = Field(description="It is told only now.")


class KeyList(Wire):
    """All keys."""

    keys: list[KeyOut]
