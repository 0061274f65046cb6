"""Requests of devices, each answered once."""

import json
import logging
from collections.abc import Callable
from typing import Any

import zenoh
from pydantic import ValidationError

import homsense
from homsense_service.answers import invalid_request, known_problem
from homsense_service.errors import ServiceError
from homsense_service.problems import INTERNAL, MALFORMED_JSON, MEDIA_TYPE, problem

JSON = zenoh.Encoding("application/json")

_log = logging.getLogger(__name__)

Expected = (ServiceError, homsense.HomsenseError, ValueError)


def told(error: Exception) -> dict[str, Any]:
    """Return the problem that an error is answered with."""
    if isinstance(error, ValidationError):
        found = error.errors(include_url=False, include_input=False, include_context=False)
        if any(entry["type"] == "json_invalid" for entry in found):
            return problem(MALFORMED_JSON, "the message cannot be read as JSON")
        return invalid_request(found)
    if isinstance(error, (ServiceError, homsense.HomsenseError)):
        return known_problem(error)
    return problem(INTERNAL, "the failure was logged")


class Request:
    """A query that waits for its answer.

    Parameters
    ----------
    query : zenoh.Query
        It hangs until it is answered.
    """

    def __init__(self, query: zenoh.Query) -> None:
        self._query, self._key = query, str(query.key_expr)
        self.method = self._key.rpartition("/")[2]
        payload, attachment = query.payload, query.attachment
        self.payload = b"" if payload is None else payload.to_bytes()
        self.attachment = None if attachment is None else attachment.to_bytes()

    @property
    def key(self) -> str:
        """The key that it came over."""
        return self._key

    def settle(self, make: Callable[[], bytes]) -> None:
        """Give the answer that is made, or say why there is none."""
        try:
            self.answer(make())
        except Exception as error:  # noqa: BLE001 - whoever asks is answered
            self.refuse(error)

    def answer(self, body: bytes) -> None:
        """Give the answer, JSON."""
        self._end(lambda: self._query.reply(self._query.key_expr, body, encoding=JSON))

    def refuse(self, error: Exception) -> None:
        """Say what is wrong."""
        body = told(error)
        if body["code"] == INTERNAL.code:
            _log.error("%s failed", self._key, exc_info=error)
        self._end(lambda: self._query.reply_err(json.dumps(body).encode(), encoding=MEDIA_TYPE))

    def _end(self, send: Callable[[], None]) -> None:
        with self._query:
            try:
                send()
            except zenoh.ZError as error:
                _log.warning("%s has no reader for its answer: %s", self._key, error)
