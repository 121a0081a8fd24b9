"""A real robot, agent and gateway: the times of a followed sample add up, from its stamp to viewers and row."""

from __future__ import annotations

import json
import threading
from pathlib import Path
from typing import Any

import httpx
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection

from metaros.clock import SystemClock
from tests.support.gateways.memory_authenticator import bearer
from tests.support.gateways.viewer import open_socket, records, subscribe
from tests.support.processes.stack import Stack
from tests.support.servers.otlp_collector import Collector, running_collector
from tests.support.waiting import wait_until

CHAIN = ["bus", "tap", "outbox", "uplink", "link", "ingest", "fanout"]  # of a sample that is kept on the robot's disk
LIVE_CHAIN = ["bus", "tap", "uplink", "link", "ingest", "fanout"]
Seen = dict[tuple[int, int], list[int]]  # by stamp and seq: when a frame with it was there


def watch(socket: ClientConnection, seen: Seen) -> None:
    """Note when each record came, until the socket ends."""
    clock = SystemClock()
    try:
        for frame in socket:
            if isinstance(frame, bytes):
                at_ns = clock.wall_ns()
                for record in records(frame):
                    seen.setdefault((record.stamp_ns, record.seq), []).append(at_ns)
    except ConnectionClosed:
        return


def complete(stack: Stack, delivery: str) -> list[dict[str, Any]]:
    """Traces of a class that viewers have seen, and that are stored if they are to be."""
    answer = httpx.get(f"{stack.url}/api/v1/traces", params={"limit": 256}, headers=bearer(stack.key), trust_env=False)
    wanted = {"fanout", "store"} if delivery == "bulk" else {"fanout"}
    found = [trace for trace in answer.json()["traces"] if trace["class"] == delivery]
    return [trace for trace in found if wanted <= {span["name"] for span in trace["spans"]}]


def check(trace: dict[str, Any], seen: Seen) -> None:
    """Its stages touch, begin with the sample's own stamp, and no viewer has it before it was given out."""
    spans = {span["name"]: span for span in trace["spans"]}
    chain = LIVE_CHAIN if trace["class"] == "live" else CHAIN
    assert [span["name"] for span in trace["spans"]] == chain + (["store"] if "store" in spans else [])
    at_ns = trace["start_ns"]
    for name in chain:
        assert spans[name]["start_ns"] == at_ns, name
        assert spans[name]["end_ns"] >= at_ns, name
        at_ns = spans[name]["end_ns"]
    ends = [at_ns]
    if "store" in spans:
        assert spans["store"]["start_ns"] == spans["ingest"]["end_ns"]
        ends.append(spans["store"]["end_ns"])
    assert trace["total_ns"] == max(ends) - trace["start_ns"]
    took_ns = sum(spans[name]["end_ns"] - spans[name]["start_ns"] for name in chain)
    assert took_ns == spans["fanout"]["end_ns"] - trace["start_ns"] > 0
    if trace["clock_adjusted"]:
        return
    stamp_ns = trace["start_ns"] - trace["clock_offset_ns"]
    came = seen.get((stamp_ns, trace["seq"]))  # only who has the same stamp and number is this very sample
    assert came is not None, trace
    assert spans["link"]["end_ns"] <= spans["fanout"]["start_ns"] <= min(came), "gateway and viewer have one clock"


def check_exported(trace: dict[str, Any], collector: Collector) -> None:
    """The collector has the same times, under one root span."""
    spans = {span.name: span for span in collector.spans[trace["trace_id"]]}
    root = spans.pop("sample")
    assert root.start_time_unix_nano == trace["start_ns"]
    assert root.end_time_unix_nano - root.start_time_unix_nano == trace["total_ns"]
    assert {span.parent_span_id for span in spans.values()} == {root.span_id}
    assert {name: (span.start_time_unix_nano, span.end_time_unix_nano) for name, span in spans.items()} == {
        span["name"]: (span["start_ns"], span["end_ns"]) for span in trace["spans"]
    }


def check_log(output: str) -> None:
    """Each line but those that it prints when it is ready is a JSON object; those of requests say whose they were."""
    logged = [line for line in output.splitlines() if line and not line.startswith(("gateway ready", "  "))]
    lines = [json.loads(line) for line in logged]
    asked = [line for line in lines if line["logger"] == "gateway.access" and "/api/v1/traces 200" in line["message"]]
    assert asked
    assert {line["level"] for line in asked} == {"info"}
    assert len({line["request_id"] for line in asked}) == len(asked)
    assert {line["principal"] for line in asked} == {"key:local"}


@pytest.mark.integration
def test_the_times_of_one_sample_add_up_from_its_stamp_to_viewers_and_row(tmp_path: Path) -> None:
    settings = tmp_path / "agent.toml"
    settings.write_text('trace_every = 5\n[[topics]]\nmatch = "**/odom"\nclass = "bulk"\n')
    seen: Seen = {}
    with running_collector() as collector, Stack(tmp_path) as stack:
        stack.router()
        gateway = stack.gateway("--otlp", collector.url, "--log-format", "json", "--log-level", "info")
        with open_socket(stack.url, "/api/v1/stream", key=stack.key) as socket:
            viewer = threading.Thread(target=watch, args=(socket, seen))
            viewer.start()
            subscribe(socket, 1, "*", "**", mode="queue")
            stack.sim("--no-camera")
            stack.agent("sim_1", "--config", str(settings))
            found: dict[str, list[dict[str, Any]]] = {}

            def followed() -> bool:
                found.update({delivery: complete(stack, delivery) for delivery in ("live", "bulk")})
                return all(len(traces) >= 3 for traces in found.values())

            wait_until(followed, timeout_s=120, every_s=0.1)
            traces = [trace for some in found.values() for trace in some]
            wait_until(lambda: all(trace["trace_id"] in collector.spans for trace in traces), timeout_s=60)
            socket.close()
            viewer.join()
    for trace in traces:
        check(trace, seen)
        check_exported(trace, collector)
    assert collector.services == {"metaros-gateway"}
    check_log(gateway.output)
