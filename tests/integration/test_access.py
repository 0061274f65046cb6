"""Who may do what, and what strangers learn: nothing."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi.testclient import TestClient
from homsense_cli import stored
from homsense_cli.__main__ import app as command
from homsense_client import Client
from homsense_service.app import create_app
from homsense_service.keys import SCOPES, hash_of, new_key
from homsense_service.server import serve
from homsense_service.settings import Settings
from homsense_service.store import SqliteStore
from support.builders import SITE_MAP
from typer.testing import CliRunner

OPEN = {"/healthz", "/readyz"}


def scan(number: int, *landmarks: Any, device: str = "phone") -> dict[str, Any]:
    return {"device": device, "scan_id": str(number), "observed_at": 1.7e9,
        "landmarks": list(landmarks)}  # fmt: skip


class Guarded:
    """A service with a key for each purpose."""

    def __init__(self, api: TestClient, tokens: dict[str, str]) -> None:
        self.api, self.tokens = api, tokens

    def ask(self, who: str | None, method: str, path: str, body: Any = None) -> Any:
        headers = {} if who is None else {"authorization": f"Bearer {self.tokens[who]}"}
        return self.api.request(method, path, json=body, headers=headers)


@pytest.fixture
def guarded(tmp_path: Path) -> Iterator[Guarded]:
    tokens: dict[str, str] = {
        scope: stored.add_key(tmp_path, scope, [scope], None) for scope in SCOPES
    }
    tokens["tenant"] = stored.add_key(tmp_path, "tenant", ["admin"], ["mine"])
    with TestClient(create_app(Settings(data=tmp_path))) as api:
        service = Guarded(api, tokens)
        for site in ("mine", "theirs"):
            assert service.ask("admin", "PUT", f"/v1/sites/{site}", {}).status_code == 201
            service.ask("admin", "PUT", f"/v1/sites/{site}/map", SITE_MAP)
            service.ask(
                "ingest", "POST", f"/v1/sites/{site}/scans", {"scans": [scan(1, "a", "b")]}
            )
        yield service


def test_every_route_asks_for_a_key(guarded: Guarded) -> None:
    paths = guarded.api.get("/openapi.json").json()["paths"]
    assert len(paths) > 20
    for path, verbs in paths.items():
        for verb, told in verbs.items():
            concrete = re.sub(r"\{[^}]*\}", "1", path)
            answer = guarded.api.request(verb.upper(), concrete)
            if path in OPEN:
                assert answer.status_code == 200
                continue
            assert (answer.status_code, answer.json()["code"]) == (401, "unauthorized"), path
            assert answer.headers["www-authenticate"] == "Bearer"
            wrong = {"authorization": "Bearer homsense_guess"}
            assert guarded.api.request(verb.upper(), concrete, headers=wrong).status_code == 401
            assert told["security"], path
            assert {"401", "403", "429"} <= told["responses"].keys(), path


@pytest.mark.parametrize(
    ("method", "path", "body", "scopes"),
    [
        ("GET", "/v1/sites", None, {"read"}),
        ("GET", "/v1/sites/mine/complex", None, {"read"}),
        ("POST", "/v1/sites/mine/local-homology", {"landmarks": ["a"]}, {"read"}),
        ("PUT", "/v1/sites/mine", {}, set()),
        ("PUT", "/v1/sites/mine/map", SITE_MAP, set()),
        ("POST", "/v1/sites/mine/scans", {"scans": [scan(2, "a")]}, {"ingest"}),
        ("DELETE", "/v1/sites/mine/devices/phone", None, set()),
        ("POST", "/v1/sites/mine/sessions", {"particles": 10}, {"localize"}),
        ("GET", "/v1/sites/mine/sessions", None, {"localize"}),
        ("GET", "/v1/keys", None, set()),
        ("GET", "/metrics", None, {"read"}),
        ("DELETE", "/v1/sites/mine", None, set()),
    ],
)
def test_a_key_is_good_for_its_scopes(
    guarded: Guarded, method: str, path: str, body: Any, scopes: set[str]
) -> None:
    for scope in ("ingest", "localize", "read"):
        answer = guarded.ask(scope, method, path, body)
        if scope in scopes:
            assert answer.is_success, answer.text
        else:
            assert (answer.status_code, answer.json()["code"]) == (403, "forbidden")
    assert guarded.ask("admin", method, path, body).is_success


def test_another_tenant_does_not_exist(guarded: Guarded) -> None:
    opened = guarded.ask("admin", "POST", "/v1/sites/theirs/sessions", {"particles": 10}).json()
    theirs, nobody = opened["session"], "x" * len(opened["session"])
    for method, path, body in (
        ("GET", "/v1/sites/{}", None),
        ("PUT", "/v1/sites/{}", {}),
        ("DELETE", "/v1/sites/{}", None),
        ("GET", "/v1/sites/{}/complex", None),
        ("POST", "/v1/sites/{}/scans", {"scans": [scan(3, "a")]}),
        ("POST", "/v1/sites/{}/sessions", {}),
        ("DELETE", "/v1/sites/{}/devices/phone", None),
    ):
        there = guarded.ask("tenant", method, path.format("theirs"), body)
        nowhere = guarded.ask("tenant", method, path.format("nobody"), body)
        assert there.status_code == nowhere.status_code == 404
        assert there.text.replace("theirs", "nobody") == nowhere.text
    for method, path, body in (
        ("GET", "/v1/sessions/{}/pose", None),
        ("POST", "/v1/sessions/{}/steps", {"steps": [{"seq": 1}]}),
        ("DELETE", "/v1/sessions/{}", None),
    ):
        there = guarded.ask("tenant", method, path.format(theirs), body)
        nowhere = guarded.ask("tenant", method, path.format(nobody), body)
        assert there.status_code == nowhere.status_code == 404
        assert there.text.replace(theirs, nobody) == nowhere.text
    listed = guarded.ask("tenant", "GET", "/v1/sites").json()["sites"]
    assert [site["site"] for site in listed] == ["mine"]
    told = guarded.ask("tenant", "GET", "/v1/info").json()
    assert (told["sites"], told["sessions"]) == (1, 0)
    for path in ("/v1/keys", "/metrics"):
        assert guarded.ask("tenant", "GET", path).json()["code"] == "forbidden"
    assert guarded.ask("admin", "GET", "/v1/sites/theirs").is_success


def test_keys_are_made_and_removed_over_rest(guarded: Guarded) -> None:
    wanted = {"name": "phones", "scopes": ["ingest"], "sites": ["mine"]}
    made = guarded.ask("admin", "POST", "/v1/keys", wanted)
    assert made.status_code == 201
    guarded.tokens["phones"] = made.json()["key"]
    batch = {"scans": [scan(9, "a")]}
    assert guarded.ask("phones", "POST", "/v1/sites/mine/scans", batch).is_success
    assert guarded.ask("phones", "POST", "/v1/sites/theirs/scans", batch).status_code == 404
    again = guarded.ask("admin", "POST", "/v1/keys", wanted)
    assert (again.status_code, again.json()["code"]) == (409, "key_exists")
    listed = guarded.ask("admin", "GET", "/v1/keys")
    assert [key["name"] for key in listed.json()["keys"]] == sorted([*SCOPES, "phones", "tenant"])
    assert made.json()["key"] not in listed.text
    assert guarded.ask("admin", "DELETE", "/v1/keys/phones").status_code == 204
    assert guarded.ask("phones", "POST", "/v1/sites/mine/scans", batch).status_code == 401
    assert guarded.ask("admin", "DELETE", "/v1/keys/phones").json()["code"] == "key_not_found"


def test_the_command_makes_lists_and_removes_keys(tmp_path: Path) -> None:
    def run(*words: str) -> str:
        result = CliRunner().invoke(command, ["keys", *words, "--data", str(tmp_path)])
        assert result.exit_code == 0, result.output
        return result.output.strip()

    token = run("add", "robots", "--scope", "localize", "--scope", "read", "--site", "hall")
    listed = run("list")
    assert "robots" in listed
    assert "hall" in listed
    assert token not in listed
    with TestClient(create_app(Settings(data=tmp_path))) as api:
        assert api.get("/v1/sites").status_code == 401
        headers = {"authorization": f"Bearer {token}"}
        assert api.get("/v1/sites", headers=headers).json() == {"sites": [], "next": None}
    assert token not in (tmp_path / "homsense.sqlite3").read_bytes().decode("latin-1")
    run("remove", "robots")
    with TestClient(create_app(Settings(data=tmp_path))) as api:
        assert api.get("/v1/sites").status_code == 200
    for words in (["add", "bad name", "--scope", "read"], ["add", "a", "--scope", "all"]):
        result = CliRunner().invoke(command, ["keys", *words, "--data", str(tmp_path)])
        assert result.exit_code != 0


def test_keys_are_random_and_only_their_hash_is_kept() -> None:
    made = [new_key("a", ["read"], None, 0.0) for _ in range(50)]
    assert len({token for token, _ in made}) == 50
    assert all(record.hashed == hash_of(token) for token, record in made)
    with pytest.raises(ValueError, match="scope"):
        new_key("a", ["everything"], None, 0.0)


def test_a_client_shows_its_key(guarded: Guarded) -> None:
    def forward(request: httpx.Request) -> httpx.Response:
        headers = {"authorization": request.headers["authorization"]}
        answer = guarded.api.request(request.method, request.url.path, headers=headers)
        return httpx.Response(answer.status_code, content=answer.content)

    transport = httpx.MockTransport(forward)
    with Client("http://test", key=guarded.tokens["read"], transport=transport) as client:
        assert client.get_site("mine").name == "mine"


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.1", "example.test"])
def test_nobody_is_let_in_by_accident(tmp_path: Path, host: str) -> None:
    with pytest.raises(ValueError, match="homsense keys add"):
        serve(Settings(data=tmp_path, host=host, port=0))
    SqliteStore(tmp_path).close()


def test_requests_are_limited_by_key(tmp_path: Path) -> None:
    tokens = [stored.add_key(tmp_path, name, ["read"], None) for name in ("one", "other")]
    with TestClient(create_app(Settings(data=tmp_path, requests_per_minute=5))) as api:
        first, other = ({"authorization": f"Bearer {token}"} for token in tokens)
        answers = [api.get("/v1/sites", headers=first) for _ in range(8)]
        assert [answer.status_code for answer in answers] == [200] * 5 + [429] * 3
        assert answers[-1].json()["code"] == "rate_limited"
        assert 1 <= int(answers[-1].headers["retry-after"]) <= 120
        assert api.get("/v1/sites", headers=other).status_code == 200
        assert api.get("/healthz").status_code == 200


def test_pages_of_other_origins_may_call_only_when_they_are_listed(tmp_path: Path) -> None:
    origin = "https://map.example"
    asked = {"origin": origin, "access-control-request-method": "GET"}
    for allowed, header in (([], None), ([origin], origin)):
        with TestClient(create_app(Settings(data=tmp_path, cors_origins=allowed))) as api:
            answer = api.options("/v1/sites", headers=asked)
            assert answer.headers.get("access-control-allow-origin") == header


def test_answers_have_manners_and_names(api: TestClient) -> None:
    trace = "4bf92f3577b34da6a3ce929d0e0e4736"
    answer = api.get("/v1/sites", headers={"traceparent": f"00-{trace}-00f067aa0ba902b7-01"})
    assert answer.headers["x-request-id"] == trace
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert answer.headers["cache-control"] == "no-store"
    names = {api.get("/v1/nothing").headers["x-request-id"] for _ in range(3)}
    assert len(names) == 3


def test_versions_protect_against_lost_changes(api: TestClient) -> None:
    path = "/v1/sites/a"
    created = api.put(path, json={}, headers={"if-none-match": "*"})
    assert (created.status_code, created.headers["etag"]) == (201, '"1"')
    late = api.put(path, json={}, headers={"if-none-match": "*"})
    assert (late.status_code, late.json()["code"]) == (412, "precondition_failed")
    one = api.put(path, json={"name": "one"}, headers={"if-match": '"1"'})
    assert (one.status_code, one.headers["etag"]) == (200, '"2"')
    other = api.put(path, json={"name": "other"}, headers={"if-match": '"1"'})
    assert other.status_code == 412
    assert api.get(path).json()["config"]["name"] == "one"
    put = api.put(f"{path}/map", json=SITE_MAP)
    assert api.get(path).headers["etag"] == '"3"'
    tag = put.headers["etag"]
    assert api.get(f"{path}/map", headers={"if-none-match": tag}).status_code == 304
    assert api.get(f"{path}/map", headers={"if-none-match": '"x"'}).headers["etag"] == tag
    refused = api.put(f"{path}/map", json=SITE_MAP, headers={"if-match": '"x", W/"y"'})
    assert refused.status_code == 412
    assert api.put(f"{path}/map", json=SITE_MAP, headers={"if-match": f'"x", {tag}'}).is_success
    assert api.delete(path, headers={"if-match": '"1"'}).status_code == 412
    assert api.delete(path, headers={"if-match": "*"}).status_code == 204
    assert api.put("/v1/sites/b", json={}, headers={"if-match": "*"}).status_code == 412


def test_lists_come_in_pages(api: TestClient, site: str) -> None:
    for name in "dabc":
        api.put(f"/v1/sites/{name}", json={})
    found, cursor = [], None
    while True:
        query = {"limit": 2} | ({} if cursor is None else {"cursor": cursor})
        page = api.get("/v1/sites", params=query).json()
        found += [entry["site"] for entry in page["sites"]]
        if (cursor := page["next"]) is None:
            break
        api.put("/v1/sites/aa", json={})
    assert found == ["a", "b", "c", "d", site]
    for wrong in ("%%%", "_w", "A"):
        answer = api.get("/v1/sites", params={"cursor": wrong})
        assert (answer.status_code, answer.json()["code"]) == (404, "invalid_cursor")
    sessions = {
        api.post(f"/v1/sites/{site}/sessions", json={"particles": 10}).json()["session"]
        for _ in range(3)
    }
    page = api.get(f"/v1/sites/{site}/sessions", params={"limit": 3}).json()
    assert (set(page["sessions"]), page["next"]) == (sessions, None)


def test_networks_that_opted_out_are_not_kept(api: TestClient, site: str) -> None:
    heard = [
        {"id": "aa:aa", "ssid": "Home_nomap"}, {"id": "bb:bb", "ssid": "x_optout_y"},
        {"id": "cc:cc", "ssid": "Cafe"}, "Shop_nomap", "dd:dd",
    ]  # fmt: skip
    batch = {"scans": [scan(10, *heard), scan(11, "Only_nomap")]}
    answer = api.post(f"/v1/sites/{site}/scans", json=batch).json()
    assert answer["dropped"] == [{"index": 1, "reason": "landmarks: all have opted out"}]
    kept = json.dumps(api.get(f"/v1/sites/{site}/complex?format=facets").json())
    assert "cc:cc" in kept
    assert "dd:dd" in kept
    for gone in ("aa:aa", "bb:bb", "nomap", "Cafe"):
        assert gone not in kept


def test_names_can_be_kept_as_keyed_hashes(tmp_path: Path) -> None:
    numbers = []
    for key in (None, "0123456789abcdef", "fedcba9876543210"):
        data = tmp_path / str(key)
        with TestClient(create_app(Settings(data=data, hash_key=key))) as api:
            api.put("/v1/sites/a", json={"s_max_m": 20.0, "hops": [1]})
            api.put("/v1/sites/a/map", json=SITE_MAP)
            seen = [("AA-0A", "bb:0b"), ("bb:0b", "cc:0c"), ("CC:0C", "aa:0a")]
            batch = [scan(number, *pair, device="ann") for number, pair in enumerate(seen)]
            api.post("/v1/sites/a/scans", json={"scans": batch})
            numbers.append(api.get("/v1/sites/a/complex").json()["betti"])
            asked = {"landmarks": ["aa:0a"], "hops": [1]}
            numbers.append(api.post("/v1/sites/a/local-homology", json=asked).json()["known"])
            session = api.post("/v1/sites/a/sessions", json={"particles": 10}).json()["session"]
            steps = {"steps": [{"seq": 1, "landmarks": ["aa:0a"]}]}
            pose = api.post(f"/v1/sessions/{session}/steps", json=steps).json()
            numbers.append(pose["measurement"]["holes"])
            deleted = api.delete("/v1/sites/a/devices/ann").json()
            assert deleted == {"scans": 3}
            api.post("/v1/sites/a/scans", json={"scans": batch})
        written = b"".join(path.read_bytes() for path in data.iterdir())
        assert (b"aa:0a" in written or b"AA-0A" in written) == (key is None)
        assert (b"ann" in written) == (key is None)
    assert numbers[:3] == numbers[3:6] == numbers[6:]


def test_a_device_can_be_forgotten(api: TestClient, site: str) -> None:
    before = api.get(f"/v1/sites/{site}/complex").json()
    more = [scan(n, f"x{n}", "a", device="a/b c") for n in range(5)]
    api.post(f"/v1/sites/{site}/scans", json={"scans": more})
    assert api.get(f"/v1/sites/{site}/complex").json()["landmarks"] == before["landmarks"] + 5
    assert api.delete(f"/v1/sites/{site}/devices/a%2Fb%20c").json() == {"scans": 5}
    after = api.get(f"/v1/sites/{site}/complex").json()
    assert after["digest"] == before["digest"]
    assert api.delete(f"/v1/sites/{site}/devices/nobody").json() == {"scans": 0}
    assert api.post(f"/v1/sites/{site}/scans", json={"scans": more}).json()["accepted"] == 5


@pytest.mark.parametrize(
    ("settings", "path", "body", "field"),
    [
        ({"max_particles": 100}, "/v1/sites/a/sessions", {"particles": 101}, "particles"),
        (
            {"max_particles": 100}, "/v1/sites/a/sessions",
            {"particles": 10, "adaptive": {"least": 1, "most": 101}}, "adaptive.most",
        ),
    ],
)  # fmt: skip
def test_sessions_are_limited_in_size(
    tmp_path: Path, settings: dict[str, Any], path: str, body: Any, field: str
) -> None:
    with TestClient(create_app(Settings(data=tmp_path, **settings))) as api:
        api.put("/v1/sites/a", json={})
        api.put("/v1/sites/a/map", json=SITE_MAP)
        answer = api.post(path, json=body)
        assert answer.status_code == 422
        assert answer.json()["errors"][0]["field"] == field


def test_maps_are_limited_in_size(tmp_path: Path) -> None:
    with TestClient(create_app(Settings(data=tmp_path, max_map_positions=10))) as api:
        api.put("/v1/sites/a", json={})
        answer = api.put("/v1/sites/a/map", json=SITE_MAP)
        assert (answer.status_code, answer.json()["code"]) == (422, "invalid_map")
        assert "10 positions" in answer.json()["detail"]
