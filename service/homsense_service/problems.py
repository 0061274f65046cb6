"""One table: which error is answered how. Plain data for every rim; nothing here knows HTTP."""

from dataclasses import dataclass
from typing import Any

import homsense
from homsense_service import errors

MEDIA_TYPE = "application/problem+json"


@dataclass(frozen=True, slots=True)
class Kind:
    """How a class of errors is answered.

    Parameters
    ----------
    status : int
        HTTP status.
    code : str
        Stable name for programs.
    title : str
        What it means, for people.
    """

    status: int
    code: str
    title: str


KINDS: dict[type[Exception], Kind] = {
    errors.UnauthorizedError: Kind(401, "unauthorized", "Who calls?"),
    errors.TokenError: Kind(401, "bad_token", "The token is not the one of the session"),
    errors.DeviceNotFoundError: Kind(404, "no_session", "The device has no session"),
    errors.MethodNotFoundError: Kind(404, "no_such_method", "Devices cannot ask for this"),
    errors.BodyTooLargeError: Kind(413, "body_too_large", "The body is too large"),
    errors.ForbiddenError: Kind(403, "forbidden", "The key is not good for this"),
    errors.RateLimitError: Kind(429, "rate_limited", "Too many requests"),
    errors.PortableError: Kind(422, "invalid_file", "The file holds no site"),
    errors.SiteExistsError: Kind(409, "site_exists", "There is such a site"),
    errors.KeyNotFoundError: Kind(404, "key_not_found", "No such key"),
    errors.KeyExistsError: Kind(409, "key_exists", "There is such a key"),
    errors.CursorError: Kind(404, "invalid_cursor", "There is no such page"),
    errors.SiteNotFoundError: Kind(404, "site_not_found", "No such site"),
    errors.SessionNotFoundError: Kind(404, "session_not_found", "No such session"),
    errors.MapMissingError: Kind(409, "map_missing", "The site has no map"),
    errors.PreconditionError: Kind(412, "precondition_failed", "Somebody else was faster"),
    errors.SequenceConflictError: Kind(409, "sequence_conflict", "The step cannot be applied"),
    errors.IdempotencyError: Kind(
        422, "idempotency_mismatch", "The name stands for something else"
    ),
    errors.CapacityError: Kind(503, "capacity", "The service is full"),
    errors.OverloadError: Kind(503, "overload", "Too much is asked at once"),
    errors.ExpectationPendingError: Kind(503, "expectation_pending", "Not ready yet"),
    errors.ExpectationFailedError: Kind(
        409, "expectation_failed", "The sensor cannot be simulated"
    ),
    errors.RegistrationPendingError: Kind(503, "registration_pending", "Not ready yet"),
    errors.RegistrationFailedError: Kind(
        409, "registration_failed", "The crowd finds no place on the map"
    ),
    errors.StoreError: Kind(503, "store", "The store cannot be used"),
    homsense.InvalidMapError: Kind(422, "invalid_map", "The map is not valid"),
    homsense.InvalidScanError: Kind(422, "invalid_scan", "The scan is not valid"),
    homsense.InvalidComplexError: Kind(422, "invalid_complex", "The question is not valid"),
    homsense.InvalidConfigurationError: Kind(
        422, "invalid_configuration", "A parameter is out of range"
    ),
    homsense.InvalidInputError: Kind(422, "invalid_input", "The input is not valid"),
    homsense.ComputationLimitError: Kind(422, "too_large", "The answer costs too much"),
}

INVALID_REQUEST = Kind(422, "invalid_request", "The request is not valid")
MALFORMED_JSON = Kind(400, "malformed_json", "The body is not JSON")
MALFORMED_GZIP = Kind(400, "malformed_gzip", "The body is not gzip")
TOO_LARGE = KINDS[errors.BodyTooLargeError]
INTERNAL = Kind(500, "internal", "The service failed")


def kind_of(error: Exception) -> Kind:
    """Return the kind of the most specific class of an error."""
    for ancestor in type(error).__mro__:
        if ancestor in KINDS:
            return KINDS[ancestor]
    return INTERNAL


def problem(
    kind: Kind, detail: str, fields: list[tuple[str, str]] | None = None
) -> dict[str, Any]:
    """Return an RFC 9457 problem.

    Parameters
    ----------
    kind : Kind
        What went wrong.
    detail : str
        This occurrence, for people.
    fields : list of tuple of str, optional
        (dotted path, message) of each offending member of the request.

    Returns
    -------
    dict
        The body of an ``application/problem+json`` answer.
    """
    body: dict[str, Any] = {
        "type": f"urn:homsense:problem:{kind.code}",
        "title": kind.title,
        "status": kind.status,
        "code": kind.code,
        "detail": detail,
    }
    if fields:
        body["errors"] = [{"field": path, "message": message} for path, message in fields]
    return body
