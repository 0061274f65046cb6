"""Calls as values: what to send, and how to read the answer. No I/O."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar
from urllib.parse import quote

from homsense_client import _learnt as learnt
from homsense_client import _models as models
from homsense_client.errors import (
    ConflictError,
    ContractError,
    InvalidRequestError,
    NotFoundError,
    ResponseError,
    UnavailableError,
)

Answer = TypeVar("Answer")
Json = Any
Scan = Mapping[str, Json]
Landmarks = Iterable[str | Mapping[str, Any]]

_FAILURES: dict[int, type[ResponseError]] = {
    400: InvalidRequestError,
    404: NotFoundError,
    409: ConflictError,
    413: InvalidRequestError,
    422: InvalidRequestError,
    429: UnavailableError,
}
_BAD, _SERVER = 400, 500


@dataclass(frozen=True, slots=True)
class Call(Generic[Answer]):
    """One request, which may be sent twice, and the reading of its answer.

    Parameters
    ----------
    method, path : str
        Of the HTTP request.
    read : callable
        Answer body -> value.
    body : dict, optional
        Sent as JSON.
    params : dict, optional
        Query parameters.
    headers : dict, optional
        Beside the usual ones.
    """

    method: str
    path: str
    read: Callable[[Any], Answer]
    body: dict[str, Any] | None = None
    params: dict[str, str] | None = None
    headers: dict[str, str] | None = None


def read_answer(call: Call[Answer], status: int, body: object) -> Answer:
    """Return the value of an answer, or raise what it means.

    Parameters
    ----------
    call : Call
        What was sent.
    status : int
        HTTP status.
    body : object
        Parsed JSON, None when there is none.

    Returns
    -------
    Answer
        The value.

    Raises
    ------
    ResponseError
        If the service answered with a problem.
    ContractError
        If the answer does not have the promised shape.
    """
    if status >= _BAD:
        raise failure({"status": status, **(body if isinstance(body, dict) else {})})
    try:
        return call.read(body)
    except (KeyError, TypeError, ValueError) as error:
        message = f"{call.method} {call.path} was answered with something else: {error!r}"
        raise ContractError(message) from error


def failure(problem: dict[str, Any]) -> ResponseError:
    """Return the error that a problem means."""
    status = int(problem["status"])
    kind = UnavailableError if status >= _SERVER else _FAILURES.get(status, ResponseError)
    return kind(status, problem)


def put_site(site: str, config: Mapping[str, Any]) -> Call[models.Site]:
    """Create or configure a site."""
    return Call("PUT", _site(site), models.Site.from_json, dict(config))


def get_site(site: str) -> Call[models.Site]:
    """Read a site."""
    return Call("GET", _site(site), models.Site.from_json)


def delete_site(site: str) -> Call[None]:
    """Delete a site."""
    return Call("DELETE", _site(site), _nothing)


def put_map(site: str, document: Mapping[str, Any]) -> Call[models.MapInfo]:
    """Put the map of a site."""
    return Call("PUT", _site(site, "map"), models.MapInfo.from_json, dict(document))


def post_scans(site: str, scans: Iterable[Scan]) -> Call[models.Receipt]:
    """Post a batch of scans; the natural key makes it repeatable."""
    return Call("POST", _site(site, "scans"), models.Receipt.from_json, {"scans": list(scans)})


def get_complex(site: str) -> Call[models.Complex]:
    """Read the numbers of the complex."""
    return Call("GET", _site(site, "complex"), models.Complex.from_json)


def export_complex(site: str, form: str) -> Call[dict[str, Any]]:
    """Export the complex as ``facets``, ``hif`` or ``node-link``."""
    return Call("GET", _site(site, "complex"), dict, params={"format": form})


def local_homology(
    site: str, landmarks: Landmarks, hops: Iterable[int] | None, options: Mapping[str, Any]
) -> Call[models.LocalHomology]:
    """Count the holes near a scan."""
    body: dict[str, Any] = {"landmarks": list(landmarks), **options}
    if hops is not None:
        body["hops"] = list(hops)
    path = _site(site, "local-homology")
    return Call("POST", path, models.LocalHomology.from_json, body)


def get_expectation(site: str) -> Call[learnt.Expectation]:
    """Read how far the simulation of the sensor is."""
    return Call("GET", _site(site, "expectation"), learnt.Expectation.from_json)


def post_expectation(site: str) -> Call[learnt.Expectation]:
    """Begin to simulate the sensor; doing it again changes nothing."""
    return Call("POST", _site(site, "expectation"), learnt.Expectation.from_json)


def get_registration(site: str) -> Call[learnt.Registration]:
    """Ask how the crowd lies on the map."""
    return Call("GET", _site(site, "registration"), learnt.Registration.from_json)


def post_registration(site: str) -> Call[learnt.Registration]:
    """Begin to place the crowd."""
    return Call("POST", _site(site, "registration"), learnt.Registration.from_json)


def get_floors(site: str) -> Call[learnt.Floors]:
    """Read which floor a crowd walks on."""
    return Call("GET", _site(site, "floors"), learnt.Floors.from_json)


def post_floors(site: str, candidates: Iterable[str]) -> Call[learnt.Floors]:
    """Begin to place a crowd on the maps of several sites."""
    body = {"sites": list(candidates)}
    return Call("POST", _site(site, "floors"), learnt.Floors.from_json, body)


def get_diagnosis(site: str) -> Call[learnt.Diagnosis]:
    """Judge a site."""
    return Call("GET", _site(site, "diagnosis"), learnt.Diagnosis.from_json)


def height_map(site: str, hops: int) -> Call[dict[str, Any]]:
    """Read the expected holes over the map."""
    return Call("GET", _site(site, f"heightmaps/{hops}"), dict)


def open_session(site: str, options: Mapping[str, Any], key: str) -> Call[models.SessionInfo]:
    """Open a session; the key makes it repeatable."""
    path, headers = _site(site, "sessions"), {"idempotency-key": key}
    return Call("POST", path, models.SessionInfo.from_json, dict(options), headers=headers)


def post_steps(session: str, steps: Iterable[Mapping[str, Any]]) -> Call[models.Pose]:
    """Post steps; their numbers make it repeatable."""
    body = {"steps": list(steps)}
    return Call("POST", _session(session, "/steps"), models.Pose.from_json, body)


def move_session(session: str) -> Call[models.SessionInfo]:
    """Go on with the current map of the site; doing it again changes nothing."""
    return Call("POST", _session(session, "/map"), models.SessionInfo.from_json)


def get_pose(session: str) -> Call[models.Pose]:
    """Read the pose."""
    return Call("GET", _session(session, "/pose"), models.Pose.from_json)


def get_particles(session: str, count: int) -> Call[list[tuple[float, float, float]]]:
    """Read particles of equal weight."""
    params = {"n": str(count)}
    return Call("GET", _session(session, "/particles"), _particles, params=params)


def get_distribution(session: str, form: str) -> Call[dict[str, Any]]:
    """Read the distribution as ``geojson`` or ``grid``."""
    return Call("GET", _session(session, "/distribution"), dict, params={"format": form})


def close_session(session: str) -> Call[None]:
    """Close a session."""
    return Call("DELETE", _session(session), _nothing)


def _site(site: str, rest: str = "") -> str:
    path = f"/v1/sites/{quote(site, safe='')}"
    return f"{path}/{rest}" if rest else path


def _session(session: str, rest: str = "") -> str:
    return f"/v1/sessions/{quote(session, safe='')}{rest}"


def _nothing(_body: object) -> None:
    return None


def _particles(body: Any) -> list[tuple[float, float, float]]:  # noqa: ANN401 - parsed JSON
    return [(x, y, heading) for x, y, heading in body["particles"]]
