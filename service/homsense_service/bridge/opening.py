"""How a device gets a session: a new one, or one that was opened over REST."""

import json
import secrets
from typing import Annotated, Self

from pydantic import Field, StringConstraints, model_validator

from homsense_service import schemas
from homsense_service.errors import ForbiddenError, SessionNotFoundError, SiteNotFoundError
from homsense_service.keys import KeyRing
from homsense_service.operations import Operations
from homsense_service.records import Binding
from homsense_service.rendering_poses import render_session
from homsense_service.schemas.wire import NAME
from homsense_service.sessions import Session
from homsense_service.settings import Settings

TOKEN_BYTES = 8


class OpenIn(schemas.Wire):
    """What a device asks for."""

    nonce: Annotated[str, StringConstraints(min_length=8, max_length=64)]
    site: Annotated[str, StringConstraints(pattern=NAME)] | None = None
    session: Annotated[str, StringConstraints(max_length=64)] | None = None
    options: schemas.SessionIn = schemas.SessionIn()
    key: Annotated[str, StringConstraints(max_length=200)] | None = None
    pose_hz: float = Field(default=10.0, ge=0.1, le=100.0)

    @model_validator(mode="after")
    def _names_one(self) -> Self:
        if (self.site is None) == (self.session is None):
            message = "one of site (opens a session) and session (goes on with one)"
            raise ValueError(message)
        return self


class Opening:
    """Lets devices in.

    Parameters
    ----------
    operations : Operations
        What the service does.
    ring : KeyRing
        Who may come in.
    settings : Settings
        Limits, which devices are told.
    """

    def __init__(self, operations: Operations, ring: KeyRing, settings: Settings) -> None:
        self._operations, self._ring, self._settings = operations, ring, settings

    def bound(self, device: str, asked: OpenIn, before: Binding | None) -> Binding:
        """Return the binding of a device; the same for the same nonce.

        Parameters
        ----------
        device : str
            Its name.
        asked : OpenIn
            What it asks for.
        before : Binding, optional
            What it streams into until now.

        Raises
        ------
        ServiceError
            If it may not, or cannot now.
        """
        caller = self._ring.caller(asked.key)
        caller.check("localize")
        former = None if before is None else self._site_of(before)
        if former is not None and not caller.sees(former):
            message = f"device {device!r} streams into a session that this key does not see"
            raise ForbiddenError(message)
        if asked.site is not None and not caller.sees(asked.site):
            raise SiteNotFoundError(asked.site)
        if asked.session is not None:
            site = self._operations.sessions.site_of(asked.session)
            if not caller.sees(site):
                raise SessionNotFoundError(asked.session)
        return self.granted(device, asked, before, caller.name)

    def granted(
        self, device: str, asked: OpenIn, before: Binding | None, key: str = ""
    ) -> Binding:
        """Return the binding of a device that may have it."""
        if before is not None and before.nonce == asked.nonce and self._site_of(before):
            return before
        session = asked.session
        if session is None:
            assert asked.site is not None
            session = self._operations.open_session(
                asked.site, asked.options, f"device {device} {asked.nonce}"
            ).name
        token = secrets.token_bytes(TOKEN_BYTES)
        binding = Binding(device, session, asked.nonce, token, key, asked.pose_hz)
        self._operations.bind(binding)
        return binding

    def answer(self, binding: Binding) -> bytes:
        """Return what a device is told about its session."""
        session: Session = self._operations.sessions.get(binding.session)
        told = {
            "token": binding.token.hex(),
            "session": binding.session,
            "resume": session.fix.seq,
            "limits": {
                "max_bytes": self._settings.zenoh_max_bytes,
                "pose_hz": binding.pose_hz,
                "silence_s": self._settings.zenoh_silence_s,
                "grace_s": self._settings.zenoh_grace_s,
            },
            "info": render_session(session).model_dump(mode="json"),
        }
        return json.dumps(told).encode()

    def _site_of(self, binding: Binding) -> str | None:
        try:
            return self._operations.sessions.site_of(binding.session)
        except SessionNotFoundError:
            return None
