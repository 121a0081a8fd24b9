"""A real robot sends what is looked at, at the rate of who wants most; each viewer gets its own, nobody nothing."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection

from tests.support.gateways.viewer import open_socket, records, subscribe
from tests.support.processes.stack import Stack
from tests.support.waiting import wait_until

ROBOT = "watched"
TOPIC, OTHER = "/sim_1/imu", "/sim_1/odom"
CONFIG = (
    '[[topics]]\nmatch = "**/imu"\nclass = "live"\nmax_rate_hz = 30.0\n[[topics]]\nmatch = "**/odom"\nclass = "bulk"\n'
)


def stamps_of(socket: ClientConnection, stamps: list[int]) -> None:
    """Note the stamp of each sample, until the socket ends."""
    try:
        for frame in socket:
            if isinstance(frame, bytes):
                stamps += [record.stamp_ns for record in records(frame)]
    except ConnectionClosed:
        return


def watch_foxglove(socket: ClientConnection) -> None:
    """Subscribe as Foxglove does, and take a sample."""
    number = None
    while number is None:
        said = json.loads(text) if isinstance(text := socket.recv(60), str) else {}
        offered = said.get("channels", []) if said.get("op") == "advertise" else []
        number = next((channel["id"] for channel in offered if channel["topic"] == TOPIC), None)
    socket.send(json.dumps({"op": "subscribe", "subscriptions": [{"id": 3, "channelId": number}]}))
    while not (isinstance(frame := socket.recv(60), bytes) and frame[0] == 1):
        pass


def watch_rosbridge(socket: ClientConnection) -> None:
    """Subscribe as roslib does, and take a message."""
    socket.send(json.dumps({"op": "subscribe", "topic": TOPIC, "throttle_rate": 100}))
    while json.loads(socket.recv(60))["op"] != "publish":
        pass


def watch_json(socket: ClientConnection) -> None:
    """Subscribe to the gateway's own JSON, and take a message."""
    subscribe(socket, 1, ROBOT, "**/imu", encoding="json", max_rate_hz=5)
    while json.loads(socket.recv(60))["op"] != "message":
        pass


ENDPOINTS: dict[str, tuple[Callable[[ClientConnection], None], dict[str, Any]]] = {
    "/api/v1/stream": (watch_json, {}),
    f"/foxglove?robot={ROBOT}": (watch_foxglove, {"subprotocols": ["foxglove.sdk.v1"]}),
    f"/rosbridge?robot={ROBOT}": (watch_rosbridge, {}),
}


def demand_of(stack: Stack) -> Any:
    """What the robot is asked for of the topic, in Hz; None: nothing."""
    return stack.topics(ROBOT)[TOPIC]["demand_hz"]


def check_nobody_costs_nothing(stack: Stack) -> None:
    """While other topics go on, no sample of the one that nobody looks at comes."""
    wait_until(lambda: demand_of(stack) is None, every_s=0.05)
    before = stack.topics(ROBOT)
    wait_until(lambda: stack.topics(ROBOT)[OTHER]["received"] > before[OTHER]["received"] + 15, every_s=0.05)
    after = stack.topics(ROBOT)[TOPIC]["received"]
    assert after - before[TOPIC]["received"] <= 3, "what was on its way when it was told"


def check_two_rates(stack: Stack) -> None:
    """Two viewers at 30 and 1 Hz each get theirs; when the fast one leaves, the robot sends less."""
    fast: list[int] = []
    slow: list[int] = []
    with ExitStack() as opened:
        sockets, threads = [], []
        for stamps, rate in ((fast, 30.0), (slow, 1.0)):
            sockets.append(opened.enter_context(open_socket(stack.url, "/api/v1/stream", key=stack.key)))
            subscribe(sockets[-1], 1, ROBOT, "**/imu", max_rate_hz=rate)
            threads.append(threading.Thread(target=stamps_of, args=(sockets[-1], stamps)))
            threads[-1].start()
        wait_until(lambda: demand_of(stack) == 30.0)
        wait_until(lambda: len(slow) >= 4)
        sockets[0].close()
        threads[0].join()
        assert len(slow) <= (fast[-1] - fast[0]) / 1e9 + 3
        assert len(fast) >= 5 * len(slow)
        wait_until(lambda: demand_of(stack) == 1.0)
        sockets[1].close()
        threads[1].join()


@pytest.mark.integration
def test_each_viewer_gets_its_rate_and_nobody_costs_nothing(shared_gateway: Stack, tmp_path: Path) -> None:
    settings = tmp_path / "agent.toml"
    settings.write_text(CONFIG)
    with shared_gateway.beside(tmp_path) as stack:
        stack.router()
        stack.at_once(
            lambda: stack.sim("--no-camera"),
            lambda: stack.agent(ROBOT, "--config", str(settings), namespace="/sim_1"),
        )
        wait_until(lambda: ROBOT in stack.online() and {TOPIC, OTHER} <= set(stack.topics(ROBOT)))
        check_nobody_costs_nothing(stack)
        check_two_rates(stack)
        for path, (watch, options) in ENDPOINTS.items():
            check_nobody_costs_nothing(stack)
            with open_socket(stack.url, path, key=stack.key, **options) as socket:
                watch(socket)
                assert demand_of(stack) is not None, path
        check_nobody_costs_nothing(stack)
