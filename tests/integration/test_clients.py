"""The SDK against a real service on loopback."""

import asyncio
import runpy
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from fastapi.testclient import TestClient
from homsense_cli.local_service import local_service
from homsense_client import (
    AsyncClient,
    Client,
    ConflictError,
    ConnectError,
    ContractError,
    InvalidRequestError,
    NotFoundError,
    RequestTimeoutError,
    Retry,
    UnavailableError,
)
from support.builders import SITE_MAP

RING = [["a", "b"], ["b", "c"], ["c", "d"], ["d", "a"]]
SCANS = [
    {"device": "p", "scan_id": str(n), "observed_at": float(n), "landmarks": seen}
    for n, seen in enumerate(RING)
]
PATIENCE_S = 180.0  # a fresh service compiles beside, perhaps on a busy machine
AT_ONCE = Retry(first_s=0.0)


@pytest.fixture(scope="module")
def url() -> Iterator[str]:
    """A service in a process of its own."""
    with local_service() as base_url:
        yield base_url


def test_the_blocking_client_walks_the_whole_path(url: str) -> None:
    with Client(url, timeout_s=PATIENCE_S) as client:
        created = client.put_site("sync", hops=[1, 2], s_max_m=20.0)
        assert (created.name, created.map_version) == ("sync", None)
        assert client.put_map("sync", SITE_MAP).structures == 3
        receipt = client.post_scans("sync", [*SCANS, {"device": "p"}])
        assert (receipt.accepted, receipt.dropped[0][0]) == (4, 4)
        assert client.get_site("sync").observations == 4
        assert client.registration("sync").state == "none"
        assert client.register("sync").tracked == 0
        assert client.get_complex("sync").betti == (1, 1)
        assert len(client.export_complex("sync")["facets"]) == 4
        assert client.local_homology("sync", ["a"]).levels[1].holes == 1
        asked = client.local_homology("sync", ["a"], hops=[2], lasting=True, cycles=True)
        assert asked.levels[0].lasting == 1
        assert asked.levels[0].cycles is not None
        assert set(asked.levels[0].cycles[0]) == {"a", "b", "c", "d"}
        assert client.local_homology("sync", ["a"], hops=[1]).levels[0].holes == 0
        assert client.height_map("sync", 2)["hops"] == 2
        with client.open_session("sync", particles=100, seed=1) as session:
            pose = session.step({"forward_m": 1.0}, ["a"], t=1.0)
            assert (pose.seq, pose.holes) == (1, (0, 1))
            assert session.step().seq == 2
            assert session.pose().best.weight > 0.0
            assert len(session.particles(9)) == 9
            assert session.distribution("grid")["encoding"] == "base64-uint8"
        with pytest.raises(NotFoundError, match="session_not_found"):
            session.pose()
        client.delete_site("sync")
        with pytest.raises(NotFoundError, match="site_not_found"):
            client.get_site("sync")


def test_the_asynchronous_client_walks_the_whole_path(url: str) -> None:
    async def walk() -> None:
        async with AsyncClient(url, timeout_s=PATIENCE_S) as client:
            await client.put_site("async", hops=[1, 2])
            assert (await client.registration("async")).placed is None
            await client.put_map("async", SITE_MAP)
            receipts = await asyncio.gather(*(client.post_scans("async", [s]) for s in SCANS))
            assert sum(receipt.accepted for receipt in receipts) == 4
            assert (await client.get_complex("async")).betti == (1, 1)
            assert (await client.export_complex("async", "hif"))["network-type"] == "asc"
            assert (await client.get_site("async")).landmarks == 4
            assert (await client.local_homology("async", ["a"])).known == 1
            assert (await client.height_map("async", 1))["hops"] == 1
            async with await client.open_session("async", particles=100, seed=1) as session:
                assert (await session.step({"turn_rad": 0.1}, ["a"])).holes == (0, 1)
                assert (await session.pose()).seq == 1
                assert len(await session.particles()) == 500
                assert (await session.distribution())["type"] == "FeatureCollection"
            await client.delete_site("async")

    asyncio.run(walk())


def test_problems_become_errors_that_say_whose_fault(url: str) -> None:
    with Client(url, timeout_s=PATIENCE_S) as client:
        client.put_site("bare")
        with pytest.raises(ConflictError) as conflict:
            client.open_session("bare")
        assert (conflict.value.status, conflict.value.code) == (409, "map_missing")
        with pytest.raises(InvalidRequestError) as invalid:
            client.put_site("bare", s_max_m=-1)
        assert invalid.value.problem["errors"][0]["field"] == "s_max_m"


def _answering(
    *answers: httpx.Response | httpx.TransportError,
) -> tuple[httpx.MockTransport, list[str]]:
    left, asked = list(answers), list[str]()

    def handle(request: httpx.Request) -> httpx.Response:
        asked.append(request.method)
        answer = left.pop(0)
        if isinstance(answer, httpx.TransportError):
            raise answer
        return answer

    return httpx.MockTransport(handle), asked


RECEIPT = {"accepted": 1, "duplicate": 0, "dropped": [], "complex_version": 1}


def test_transient_failures_are_tried_again() -> None:
    transport, asked = _answering(
        httpx.Response(503, headers={"retry-after": "0"}),
        httpx.ConnectError("refused"),
        httpx.Response(500, text="oops"),
        httpx.Response(200, json=RECEIPT),
    )
    with Client("http://test", retry=AT_ONCE, transport=transport) as client:
        assert client.post_scans("a", SCANS[:1]).accepted == 1
    assert len(asked) == 4


def test_retries_end() -> None:
    transport, asked = _answering(*[httpx.Response(429, json={"code": "busy"})] * 3)
    with (
        Client("http://test", retry=Retry(3, 0.0), transport=transport) as client,
        pytest.raises(UnavailableError, match="busy"),
    ):
        client.get_site("a")
    assert len(asked) == 3


def test_a_session_is_opened_once_though_its_answer_was_lost(api: TestClient, site: str) -> None:
    keys: list[str] = []

    def handle(request: httpx.Request) -> httpx.Response:
        keys.append(request.headers["idempotency-key"])
        answer = api.request(
            request.method,
            request.url.path,
            content=request.content,
            headers=[*request.headers.items()],
        )
        if len(keys) == 1:
            message = "gone"
            raise httpx.ReadError(message)
        return httpx.Response(answer.status_code, content=answer.content)

    transport = httpx.MockTransport(handle)
    with Client("http://test", retry=AT_ONCE, transport=transport) as client:
        opened = client.open_session(site, particles=50)
    assert len(keys) == 2
    assert len({*keys}) == 1
    assert api.get(f"/v1/sites/{site}/sessions").json()["sessions"] == [opened.info.id]


@pytest.mark.parametrize(
    ("failure", "error"),
    [(httpx.ConnectError("no"), ConnectError), (httpx.ReadTimeout("late"), RequestTimeoutError)],
)
def test_transport_failures_have_names(
    failure: httpx.TransportError, error: type[Exception]
) -> None:
    async def ask() -> None:
        transport, _ = _answering(failure)
        async with AsyncClient("http://test", retry=Retry(1), transport=transport) as client:
            await client.get_site("a")

    with pytest.raises(error):
        asyncio.run(ask())


def test_an_answer_outside_the_contract_is_named() -> None:
    transport, _ = _answering(httpx.Response(200, json={"hello": 1}), httpx.Response(200))
    with Client("http://test", transport=transport) as client:
        for _ in range(2):
            with pytest.raises(ContractError, match="/v1/sites/a"):
                client.get_site("a")


def test_the_example_runs(url: str) -> None:
    path = Path(__file__).parents[2] / "clients" / "examples" / "quickstart.py"
    runpy.run_path(str(path), {"URL": url})
