"""The API's documents: what OpenAPI promises is what the routes answer; pages and their caching."""

from __future__ import annotations

from pathlib import Path

import pytest

from gateway.api import ROUTERS, route_paths
from gateway.api.authorization import routes_of
from gateway.api.models import common
from gateway.api.rest.times import parse_time
from gateway.errors import ERRORS, InvalidRequestError
from gateway.identity.permissions import PERMISSIONS
from metaros._proto import link_pb2
from tests.gateway.harness import ScriptedAgent, channel, client, running_gateway


async def test_answers_fit_their_models(tmp_path: Path) -> None:
    series = [link_pb2.Series(series_id=1, name="battery.x", topic="/sim_1/battery", field="x")]
    async with running_gateway(tmp_path) as ready, client(ready) as http, ScriptedAgent(ready) as agent:
        await agent.announce(channel(1, "/sim_1/chatter", "std_msgs/msg/String"), series=series)
        await agent.rows(1, [(1, 5, 1.0), (1, 6, float("nan"))])
        await agent.samples(1, 1, [b"x"])
        await agent.settled({0: 2, 1: 1})
        base = "/api/v1/robots/sim_1"
        for path, model in [
            ("/api/v1/robots", common.RobotList),
            (base, common.Robot),
            (f"{base}/topics", common.TopicList),
            (f"{base}/metrics", common.SeriesList),
            (f"{base}/metrics/range?name=battery.x&start=1970-01-01T00:00:00Z", common.MetricRange),
            ("/healthz", common.Health),
            ("/readyz", common.Ready),
            ("/api/v1/robots/nobody", common.Problem),
        ]:
            model.model_validate_json((await http.get(path)).content)
        document = (await http.get("/api/v1/openapi.json")).json()
        described = set(document["paths"])
        sockets = {path for method, path, _ in routes_of(ROUTERS) if method == "SOCKET"}
        signed = {path for path in route_paths() if path.startswith("/lambda/")}  # botocore's model describes them
        assert described == set(route_paths()) - sockets - signed - {"/api/v1/openapi.json"}
        operations = [operation for path in document["paths"].values() for operation in path.values()]
        assert len(operations) >= 51
        for operation in operations:
            assert operation["x-metaros-permission"] in {row.name for row in PERMISSIONS}
            assert {"400", "403", "429", "503"} <= operation["responses"].keys()
            for status, answer in operation["responses"].items():
                if status >= "400" and "content" in answer and not (status == "503" and "/Ready" in str(answer)):
                    assert set(answer["content"]) == {"application/problem+json"}
                    schema = answer["content"]["application/problem+json"]["schema"]
                    assert schema == {"$ref": "#/components/schemas/Problem"}
        assert "422" not in str([operation["responses"].keys() for operation in operations])


async def test_bad_queries_say_what(tmp_path: Path) -> None:
    wrong = (("start=yesterday", "yesterday"), ("points=0", "points"), ("start=now&end=-1h", "end"))
    async with running_gateway(tmp_path) as ready, client(ready) as http, ScriptedAgent(ready):
        for query, what in (*wrong, ("points=99999", "points")):
            answer = await http.get(f"/api/v1/robots/sim_1/metrics/range?name=a&{query}")
            assert (answer.status_code, answer.json()["code"]) == (400, "invalid_request"), query
            assert what in answer.json()["detail"], query


def test_times() -> None:
    assert parse_time("now", now_ns=5) == 5
    assert parse_time("-15m", now_ns=10**12) == 10**12 - 900 * 10**9
    assert parse_time("-1.5s", now_ns=0) == -1_500_000_000
    assert parse_time("1970-01-01T00:00:01Z", now_ns=0) == 10**9
    assert parse_time("1970-01-01T01:00:01.25 01:00", now_ns=0) == 1_250_000_000
    for bad in ("", "15m", "-15", "tomorrow", "0001-01-01T00:00:00Z", "9999-12-31T00:00:00Z", "-999999999d"):
        with pytest.raises(InvalidRequestError):
            parse_time(bad, now_ns=0)


def test_codes_are_unique_and_errors() -> None:
    assert len({row.code for row in ERRORS}) == len(ERRORS)
    assert all(400 <= row.http < 600 for row in ERRORS)


async def test_dashboard_files(tmp_path: Path) -> None:
    static = tmp_path / "static"
    (static / "assets").mkdir(parents=True)
    (static / "index.html").write_text("<!doctype html>the page")
    (static / "assets" / "app-1a2b.js").write_text("1")
    async with running_gateway(tmp_path, static_dir=static) as ready, client(ready) as http:
        for path in ("/", "/robots/sim_1", "/robots/host.local", "/index.html"):
            answer = await http.get(path)
            assert (answer.status_code, answer.headers["cache-control"]) == (200, "no-cache")
            assert "the page" in answer.text
        asset = await http.get("/assets/app-1a2b.js")
        assert "immutable" in asset.headers["cache-control"]
        again = await http.get("/assets/app-1a2b.js", headers={"If-None-Match": asset.headers["etag"]})
        assert again.status_code == 304
        for path in ("/assets/none.js", "/api/none", "/..%2f..%2fdata/gateway.sqlite", "/favicon.ico"):
            answer = await http.get(path)
            assert (answer.status_code, answer.json()["code"]) == (404, "not_found"), path


async def test_missing_dashboard_says_how_to_build_it(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, static_dir=tmp_path / "none") as ready, client(ready) as http:
        answer = await http.get("/")
        assert answer.status_code == 503
        assert "make setup" in answer.text
        assert (await http.get("/healthz")).status_code == 200
