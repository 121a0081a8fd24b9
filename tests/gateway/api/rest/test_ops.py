"""What operators see over HTTP: metrics of every endpoint, traced samples in scope, a report without secrets."""

from __future__ import annotations

import asyncio
import logging
from pathlib import Path

import grpc
import httpx
import pytest
from prometheus_client.parser import text_string_to_metric_families as parse

from gateway.domain.principal import Role
from gateway.ops.metric_table import METRICS
from metaros._proto import fleet_pb2, fleet_pb2_grpc, link_pb2
from metaros.clock import SystemClock
from metaros.link import pack_batch
from tests.gateway.harness import (
    EPOCH,
    RING,
    ScriptedAgent,
    channel,
    client,
    hear,
    open_socket,
    running_gateway,
    say,
)
from tests.support.gateways.memory_authenticator import bearer

ADMIN = RING.add(role=Role.ADMIN)
VIEWER = RING.add(role=Role.VIEWER)
OF_ONE = RING.add(role=Role.ADMIN, robots=("sim_1",))
Found = dict[tuple[str, ...], float]


async def scraped(http: httpx.AsyncClient) -> Found:
    """Every series by its name and its labels' values, in the order of the labels' names."""
    answer = await http.get("/metrics")
    assert answer.status_code == 200, answer.text
    return {
        (sample.name, *(value for _, value in sorted(sample.labels.items()))): sample.value
        for family in parse(answer.text)
        for sample in family.samples
    }


async def until(http: httpx.AsyncClient, series: tuple[str, ...], value: float) -> Found:
    """The scrape in which a series has that value."""
    for _ in range(2000):
        if (found := await scraped(http)).get(series) == value:
            return found
        await asyncio.sleep(0.01)
    raise AssertionError(f"{series} never is {value}: {found}")


def traced(seq: int, stamp_ns: int) -> link_pb2.Batch:
    """A sample that its robot followed."""
    batch = pack_batch(1, EPOCH, seq, [stamp_ns], [b"\0\1\0\0data"])
    batch.trace.CopyFrom(
        link_pb2.SampleTrace(
            seq=seq,
            traceparent=f"00-{seq:032x}-{'cd' * 8}-01",
            tapped_ns=stamp_ns + 1000,
            taken_ns=stamp_ns + 2000,
            accepted_ns=stamp_ns + 3000,
            sent_ns=stamp_ns + 4000,
        )
    )
    return batch


async def test_every_endpoint_is_counted_by_its_template(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN) as http, ScriptedAgent(ready):
        assert (await http.get("/api/v1/robots/sim_1")).status_code == 200
        assert (await http.get("/api/v1/robots/nobody")).status_code == 404
        for method, path in (("GET", "/no/such/page"), ("PROPFIND", "/api/v1/robots"), ("GET", "/api/v1/nothing")):
            await http.request(method, path)
        async with open_socket(ready, "/api/v1/stream") as socket:
            await hear(socket, "welcome")
            found = await until(http, ("metaros_sockets", "/api/v1/stream"), 1)
        await until(http, ("metaros_sockets", "/api/v1/stream"), 0)
        assert found["metaros_http_requests_total", "GET", "/api/v1/robots/{robot_id}", "2xx"] == 1
        assert found["metaros_http_requests_total", "GET", "/api/v1/robots/{robot_id}", "4xx"] == 1
        assert found["metaros_http_request_seconds_count", "/api/v1/robots/{robot_id}"] == 2
        routes = {(labels[0], labels[1]) for name, *labels in found if name == "metaros_http_requests_total"}
        assert not [route for _, route in routes if "no/such" in route or "nobody" in route or "nothing" in route]
        assert "PROPFIND" not in {method for method, _ in routes}
        target, metadata = f"127.0.0.1:{ready.api_grpc_port}", [("authorization", bearer(VIEWER)["Authorization"])]
        async with grpc.aio.insecure_channel(target) as calls:
            stub = fleet_pb2_grpc.FleetServiceStub(calls)
            await stub.ListRobots(fleet_pb2.ListRobotsRequest(), metadata=metadata, timeout=60)
            with pytest.raises(grpc.aio.AioRpcError):
                await stub.ListRobots(fleet_pb2.ListRobotsRequest(), metadata=[("authorization", "Bearer no")])
        method = "/metaros.v1.FleetService/ListRobots"
        found = await until(http, ("metaros_rpcs_total", method, "4xx"), 1)
        assert found["metaros_rpcs_total", method, "2xx"] == 1
        assert found["metaros_rpc_seconds_count", method] == 2


async def test_links_store_and_queues_are_counted(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=VIEWER) as http, ScriptedAgent(ready) as agent:
        await agent.announce(channel(1, "/odom", "nav_msgs/msg/Odometry"))
        stamp_ns = SystemClock().wall_ns() - 2 * 10**9
        batch = pack_batch(1, EPOCH, 1, [stamp_ns] * 3, [b"\0\1\0\0data"] * 3)
        await agent.send(batches=link_pb2.Batches(batches=[batch]))
        await until(http, ("metaros_store_samples_total",), 3)
        found = await until(http, ("metaros_link_samples_total",), 3)
        assert found["metaros_robots", "online"] == 1
        assert 2 <= found["metaros_robot_lag_seconds", "sim_1"] < 600
        assert found["metaros_lag_seconds", "0.5"] == found["metaros_robot_lag_seconds", "sim_1"]
        assert found["metaros_ready",] == found["metaros_store_ok",] == found["metaros_objects_ok",] == 1
        assert found["metaros_queue_limit_bytes", "store"] == 256 << 20
        assert found["metaros_disk_free_bytes",] > 0
        reported = {name.removesuffix("_total").removesuffix("_bucket").removesuffix("_count") for name, *_ in found}
        silent = {"metaros_link_rtt_seconds", "metaros_rpcs", "metaros_rpc_seconds", "metaros_sample_stage_seconds"}
        silent |= {"metaros_http_requests", "metaros_http_request_seconds"}  # this may be the first one
        silent |= {"metaros_sockets", "metaros_sockets_opened", "metaros_store_bytes"}
        silent |= {"metaros_deliveries_ended", "metaros_function_duration_seconds"}  # no function was called
        silent |= {row.name for row in METRICS if row.name.startswith("metaros_cluster_")}  # it is alone
        assert {row.name for row in METRICS} - reported <= silent, "all others have a value at once"


async def test_a_followed_sample_is_seen_by_who_sees_its_robot(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=OF_ONE) as http:
        async with ScriptedAgent(ready, "sim_1") as one, ScriptedAgent(ready, "sim_2", session=b"2" * 16) as two:
            async with open_socket(ready, "/api/v1/stream") as socket:
                await hear(socket, "welcome")
                await say(socket, op="subscribe", id=1, robots="*", topics="**", mode="queue")
                await say(socket, op="subscribe_fleet", id=2)
                await hear(socket, "fleet")  # by now it has the first one, too
                stamp_ns = SystemClock().wall_ns()
                for agent in (two, one):
                    await agent.announce(channel(1, "/odom", "nav_msgs/msg/Odometry"))
                    await agent.send(batches=link_pb2.Batches(batches=[traced(1, stamp_ns)]))
                for _ in range(2000):
                    found = (await http.get("/api/v1/traces")).json()["traces"]
                    if found:
                        break
                    await asyncio.sleep(0.01)
                (trace,) = found
                assert (trace["robot"], trace["topic"], trace["class"], trace["seq"]) == ("sim_1", "/odom", "bulk", 1)
                names = [span["name"] for span in trace["spans"]]
                assert names == ["bus", "tap", "outbox", "uplink", "link", "ingest", "fanout", "store"]
                assert [span["end_ns"] - span["start_ns"] for span in trace["spans"][:4]] == [1000] * 4
                assert trace["start_ns"] == stamp_ns
                for asked, count in (("topic=/odom", 1), ("topic=/scan", 0), ("robot=sim_2", 0), ("limit=1", 1)):
                    assert len((await http.get(f"/api/v1/traces?{asked}")).json()["traces"]) == count, asked
                assert (await http.get("/api/v1/traces?limit=0")).status_code == 400
                async with client(ready, key=ADMIN) as everybody:
                    stages = await until(everybody, ("metaros_sample_stage_seconds_count", "fanout"), 2)
                    assert stages["metaros_traces_followed_total",] == 2
                    assert len((await everybody.get("/api/v1/traces")).json()["traces"]) == 2


async def test_metrics_and_report_are_of_all_robots_or_not_at_all(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready:
        async with client(ready, key=OF_ONE) as http:
            for path in ("/metrics", "/api/v1/debug"):
                assert (await http.get(path)).status_code == 403, path
        async with client(ready, key="") as http:
            assert (await http.get("/metrics")).status_code == 200, "on loopback nobody known is a viewer"
            assert (await http.get("/api/v1/debug")).status_code == 401
    async with running_gateway(tmp_path / "b", anonymous=False) as ready, client(ready, key="") as http:
        assert (await http.get("/metrics")).status_code == 401


async def test_the_report_has_tasks_and_settings_and_no_secret(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, otlp="http://user:hunter2@127.0.0.1:9/") as ready:
        async with client(ready, key=ADMIN) as http:
            report = (await http.get("/api/v1/debug")).json()
            text = (await http.get("/api/v1/debug?format=text")).text
            assert (await http.get("/api/v1/debug?format=xml")).status_code == 400
        key = (ready.data_dir / "local.key").read_text().strip()
    assert report["checks"] == {"store": "ok"}
    assert report["robots"] == {"known": 0, "online": 0, "elsewhere": 0}
    assert report["settings"]["data_dir"] == str(ready.data_dir)
    assert report["settings"]["otlp"] == "(set)"
    assert any("ConnectionLimits.run" in row["runs"] for row in report["tasks"])
    assert report["numbers"]["metaros_ready"] == 1
    assert "ConnectionLimits.run" in text
    for secret in ("hunter2", key, ADMIN):
        assert secret not in str(report)
        assert secret not in text


async def test_every_answer_has_a_number_and_its_log_line_says_whose_it_was(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "gateway.access")
    async with running_gateway(tmp_path) as ready, client(ready, key=VIEWER) as http:
        assert (await http.get("/healthz", headers={"x-request-id": "mine-1.a_B"})).headers[
            "x-request-id"
        ] == "mine-1.a_B"
        made = [(await http.get("/api/v1/robots/none")).headers["x-request-id"] for _ in range(2)]
        assert len(set(made)) == 2
        for wrong in ("a b", "x" * 65, "é".encode(), "<script>"):
            assert (await http.get("/healthz", headers={"x-request-id": wrong})).headers["x-request-id"] != wrong
    lines = [item.getMessage() for item in caplog.records if item.name == "gateway.access"]
    assert [line.rpartition(" in ")[0] for line in lines[:2]] == [
        "GET /healthz 200",
        "GET /api/v1/robots/{robot_id} 404",
    ]
