"""The blocking shell around the protocol."""

import secrets
import time
from collections.abc import Iterable, Mapping
from types import TracebackType
from typing import Any, Self

import httpx

from homsense_client import _learnt as learnt
from homsense_client import _models as models
from homsense_client import _protocol as protocol
from homsense_client._retry import Retry, is_transient
from homsense_client._transport import as_client_error, authorization, parsed, prepared


class Client:
    """A blocking client of one service.

    Parameters
    ----------
    base_url : str
        Such as ``http://127.0.0.1:8080``.
    key : str, optional
        An API key of the service.
    retry : Retry, optional
        When to try again.
    timeout_s : float, default 30.0
        Longest wait for an answer, seconds.
    transport : httpx.BaseTransport, optional
        Replaces the network, in tests.
    """

    def __init__(
        self,
        base_url: str,
        *,
        key: str | None = None,
        retry: Retry | None = None,
        timeout_s: float = 30.0,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        self._retry = retry or Retry()
        self._http = httpx.Client(
            base_url=base_url, timeout=timeout_s, transport=transport, headers=authorization(key)
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Release the connections."""
        self._http.close()

    def send(self, call: protocol.Call[protocol.Answer]) -> protocol.Answer:
        """Send a call, again after transient failures, and read its answer."""
        failed = 0
        while True:
            failed += 1
            try:
                answer = self._http.request(**prepared(call))
            except httpx.TransportError as error:
                wait = self._retry.wait_s(failed)
                if wait is None:
                    raise as_client_error(error) from error
            else:
                wait = self._retry.wait_s(failed, answer.headers)
                if wait is None or not is_transient(answer.status_code):
                    return protocol.read_answer(call, answer.status_code, parsed(answer))
            time.sleep(wait)

    def put_site(self, site: str, **config: protocol.Json) -> models.Site:
        """Create or configure a site."""
        return self.send(protocol.put_site(site, config))

    def get_site(self, site: str) -> models.Site:
        """Read a site."""
        return self.send(protocol.get_site(site))

    def delete_site(self, site: str) -> None:
        """Delete a site with everything in it."""
        return self.send(protocol.delete_site(site))

    def put_map(self, site: str, document: Mapping[str, Any]) -> models.MapInfo:
        """Put the map of a site: GeoJSON polygons."""
        return self.send(protocol.put_map(site, document))

    def post_scans(self, site: str, scans: Iterable[protocol.Scan]) -> models.Receipt:
        """Post up to 1000 scans; they are durable when this returns."""
        return self.send(protocol.post_scans(site, scans))

    def get_complex(self, site: str) -> models.Complex:
        """Read the numbers of the landmark complex."""
        return self.send(protocol.get_complex(site))

    def export_complex(self, site: str, form: str = "facets") -> dict[str, Any]:
        """Export the complex as ``facets``, ``hif`` or ``node-link``."""
        return self.send(protocol.export_complex(site, form))

    def local_homology(
        self,
        site: str,
        landmarks: protocol.Landmarks,
        hops: Iterable[int] | None = None,
        **options: protocol.Json,
    ) -> models.LocalHomology:
        """Count the holes near a scan; options are `r_pseudo_m`, `lasting` and `cycles`."""
        return self.send(protocol.local_homology(site, landmarks, hops, options))

    def expectation(self, site: str) -> learnt.Expectation:
        """Read how far the simulation of the sensor is, and what it has taught."""
        return self.send(protocol.get_expectation(site))

    def expect(self, site: str) -> learnt.Expectation:
        """Begin to simulate what the sensor counts."""
        return self.send(protocol.post_expectation(site))

    def registration(self, site: str) -> learnt.Registration:
        """Return how far the registration of a crowd is, and where it lies."""
        return self.send(protocol.get_registration(site))

    def register(self, site: str) -> learnt.Registration:
        """Begin to place the crowd of a site on its map."""
        return self.send(protocol.post_registration(site))

    def floors(self, site: str) -> learnt.Floors:
        """Return which of several floors the crowd of a site walks on."""
        return self.send(protocol.get_floors(site))

    def rank_floors(self, site: str, candidates: Iterable[str]) -> learnt.Floors:
        """Begin to place the crowd of a site on the maps of several sites."""
        return self.send(protocol.post_floors(site, candidates))

    def diagnosis(self, site: str) -> learnt.Diagnosis:
        """Judge a site: whether counting holes helps, and what could be set."""
        return self.send(protocol.get_diagnosis(site))

    def height_map(self, site: str, hops: int) -> dict[str, Any]:
        """Read the expected holes over the map."""
        return self.send(protocol.height_map(site, hops))

    def open_session(self, site: str, **options: protocol.Json) -> "Session":
        """Open a session on a site; use it as a context manager."""
        call = protocol.open_session(site, options, secrets.token_hex(16))
        return Session(self, self.send(call))


class Session:
    """A device's run on a site; numbers its steps itself.

    Parameters
    ----------
    client : Client
        Sends the calls.
    info : SessionInfo
        What the service said when the session was opened.
    """

    def __init__(self, client: Client, info: models.SessionInfo) -> None:
        self._client = client
        self._seq = info.pose.seq
        self.info = info

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def step(
        self,
        delta: Mapping[str, Any] | None = None,
        landmarks: protocol.Landmarks | None = None,
        *,
        t: float | None = None,
        **motion: protocol.Json,
    ) -> models.Pose:
        """Report motion since the last step and, if there is one, a scan; return the pose.

        In place of `delta` the motion may be ``imu=[...]`` or ``walked={...}``.
        """
        step: dict[str, Any] = {"seq": self._seq + 1, "t": t, **motion}
        if delta is not None:
            step["delta"] = dict(delta)
        if landmarks is not None:
            step["landmarks"] = list(landmarks)
        pose = self._client.send(protocol.post_steps(self.info.id, [step]))
        self._seq += 1
        return pose

    def pose(self) -> models.Pose:
        """Read the pose."""
        return self._client.send(protocol.get_pose(self.info.id))

    def particles(self, count: int = 500) -> list[tuple[float, float, float]]:
        """Read particles of equal weight: x m, y m, heading rad."""
        return self._client.send(protocol.get_particles(self.info.id, count))

    def distribution(self, form: str = "geojson") -> dict[str, Any]:
        """Read the distribution as ``geojson`` or ``grid``."""
        return self._client.send(protocol.get_distribution(self.info.id, form))

    def move_to_current_map(self) -> models.SessionInfo:
        """Go on with the current map of the site."""
        self.info = self._client.send(protocol.move_session(self.info.id))
        return self.info

    def close(self) -> None:
        """Close the session at the service."""
        self._client.send(protocol.close_session(self.info.id))
