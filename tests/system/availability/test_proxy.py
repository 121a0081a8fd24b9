"""Behind a plain HTTP/1.1 proxy, which carries no gRPC, the agent finds the WebSocket and keeps the contract."""

from __future__ import annotations

import json
import sqlite3
import threading
import urllib.request
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import metaros
from metaros.interfaces.std_msgs.msg import String
from tests.support.processes.stack import Program, Stack
from tests.support.robots.checker import payloads_of
from tests.support.servers.certificates import make_certificate
from tests.support.servers.nginx import Nginx, nginx_program
from tests.support.waiting import wait_until

CONFIG = """
compression = "zstd"

[[topics]]
match = "/sim_1/numbers"
class = "bulk"
"""


class Numbers:
    """A robot's node that publishes 1, 2, 3 … until told to stop."""

    def __init__(self, zenoh_port: int) -> None:
        self.context = metaros.Context(connect=f"tcp/127.0.0.1:{zenoh_port}")
        self.node = metaros.Node("counter", namespace="/sim_1", context=self.context)
        quality = metaros.QoSProfile(history=metaros.History.KEEP_ALL, reliability=metaros.Reliability.RELIABLE)
        self.publisher = self.node.create_publisher(String, "numbers", quality)
        self.count = 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def hello(self) -> None:
        """Publish something that is no number."""
        self.publisher.publish(String(data="hello"))

    def start(self) -> None:
        """Begin to count."""
        self._thread.start()

    def _run(self) -> None:
        while not self._stop.wait(0.002):
            self.count += 1
            self.publisher.publish(String(data=f"{self.count:08d} " + "and so on, " * 8))

    def close(self) -> None:
        """Stop and leave."""
        self._stop.set()
        if self._thread.ident is not None:
            self._thread.join(60)
        self.node.close()
        self.context.close()


@contextmanager
def numbers(zenoh_port: int) -> Iterator[Numbers]:
    """A counter that is ended whatever happens."""
    counter = Numbers(zenoh_port)
    try:
        yield counter
    finally:
        counter.close()


def enrol(stack: Stack, url: str, robot: str = "sim_1") -> None:
    """Behind a proxy no robot is local: it needs an identity, and gets it through the proxy."""
    body = json.dumps({"robot": robot}).encode()
    headers = {"Authorization": f"Bearer {stack.key}", "Content-Type": "application/json"}
    request = urllib.request.Request(f"{stack.url}/api/v1/enrolment-tokens", data=body, headers=headers)
    with urllib.request.urlopen(request, timeout=30) as answer:
        token = json.load(answer)["token"]
    where = ("--name", robot, "--gateway", url, "--state-dir", str(stack.folder / "agent"))
    program = stack.start("enrol", "agent", "enrol", token, *where, ready=False)
    assert program.process.wait(60) == 0, program.output


def start_agent(stack: Stack, url: str, robot: str = "sim_1") -> Program:
    """The real agent, told nothing but the proxy's address."""
    config = stack.folder / "agent.toml"
    config.write_text(CONFIG)
    return stack.start(
        f"agent-{robot}",
        *("agent", "--name", robot, "--namespace", f"/{robot}", "--gateway", url, "--config", str(config)),
        *("--zenoh-port", str(stack.zenoh_port), "--state-dir", str(stack.folder / "agent"), "--no-host-metrics"),
    )


def link(stack: Stack, robot: str = "sim_1") -> dict[str, Any]:
    """What the gateway says of the robot's link now; empty while it is offline."""
    found = stack.get(f"/api/v1/robots/{robot}")
    return dict(found["link"]) if found and found["state"] == "online" else {}


def grow(counter: Numbers, more: int = 300) -> None:
    """Let it count on."""
    target = counter.count + more
    wait_until(lambda: counter.count >= target, timeout_s=60)


def stored_numbers(database: Path) -> Counter[int]:
    """How often each number is stored, in a database that nobody writes."""
    connection = sqlite3.connect(f"file:{database}?mode=ro", uri=True)
    connection.row_factory = sqlite3.Row
    try:
        texts = [
            data[8:-1].decode()
            for row in connection.execute("SELECT * FROM sample_batches")
            for data in payloads_of(row)
        ]
    finally:
        connection.close()
    return Counter(int(text.split()[0]) for text in texts if text[:1].isdigit())


def test_nothing_is_lost_over_restarts_of_the_proxy_and_a_kill_of_the_gateway(tmp_path: Path) -> None:
    nginx_program()
    with Stack(tmp_path) as stack:
        stack.router()
        gateway = stack.gateway()
        with Nginx(tmp_path / "nginx", stack.http_port) as nginx, numbers(stack.zenoh_port) as counter:
            enrol(stack, nginx.url)
            agent = start_agent(stack, nginx.url)
            wait_until(lambda: link(stack).get("transport") == "websocket", timeout_s=60)
            assert link(stack)["gateway"] == nginx.url

            def received() -> bool:
                counter.hello()
                return "/sim_1/numbers" in stack.topics("sim_1")

            wait_until(received, timeout_s=60, every_s=0.1)
            wait_until(lambda: counter.publisher.events.matched)
            counter.start()
            grow(counter)

            nginx.stop()
            grow(counter)
            nginx.start()
            wait_until(lambda: link(stack).get("reconnects", 0) >= 1, timeout_s=60)
            grow(counter)

            gateway.kill()
            grow(counter)
            gateway = stack.restart(gateway)
            wait_until(lambda: link(stack).get("reconnects", 0) >= 2, timeout_s=60)
            grow(counter)

            count = counter.count
            wait_until(lambda: stored_numbers(tmp_path / "data" / "gateway.sqlite")[count] == 1, timeout_s=60)
        assert "by websocket" in agent.output
    # Everybody is gone: the store is what it will be.
    found = stored_numbers(tmp_path / "data" / "gateway.sqlite")
    assert set(range(1, count + 1)) - set(found) == set(), "lost"
    assert [number for number, times in found.items() if times > 1] == [], "duplicate"


@pytest.mark.integration
def test_https_and_a_path_on_a_shared_proxy(
    shared_gateway: Stack, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    nginx_program()
    certificate = make_certificate(tmp_path)
    monkeypatch.setenv("SSL_CERT_FILE", str(certificate))
    for robot, path in (("proxied", ""), ("proxied_at_a_path", "/fleet")):  # there is no gRPC to try first at a path
        folder = tmp_path / robot
        folder.mkdir()
        with shared_gateway.beside(folder) as stack, Nginx(folder / "n", stack.http_port, path, certificate) as nginx:
            stack.router()
            enrol(stack, nginx.url, robot)
            start_agent(stack, nginx.url, robot)
            wait_until(lambda s=stack, r=robot: link(s, r).get("transport") == "websocket", timeout_s=60)  # type: ignore[misc]


@pytest.mark.integration
def test_a_proxy_with_an_untrusted_certificate_gets_nothing(shared_gateway: Stack, tmp_path: Path) -> None:
    nginx_program()
    certificate = make_certificate(tmp_path)
    with (
        shared_gateway.beside(tmp_path) as stack,
        Nginx(tmp_path / "nginx", stack.http_port, "", certificate) as nginx,
    ):
        stack.router()
        agent = start_agent(stack, nginx.url)
        wait_until(lambda: "certificate" in agent.output.lower(), timeout_s=60)
        assert "link up" not in agent.output
