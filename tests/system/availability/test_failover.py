"""Two gateways that share one store: the agent goes from one to the other, and nothing is lost or stored twice."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from gateway.store import Store
from gateway.store.retention import Retention
from gateway.store.telemetry.samples import StoredBatch
from metaros.clock import SystemClock
from tests.support.ports import free_port
from tests.support.processes.stack import Program, Stack
from tests.support.robots.uplinks import Owner, feed, running, wait
from tests.support.servers.postgres import PostgresServer


def start_gateway(stack: Stack, name: str, url: str, port: int) -> Program:
    """A gateway process whose agents notice its silence soon."""
    options = ("--store", url, "--heartbeat-s", "0.5", "--port", str(free_port()), "--grpc-port", str(port))
    return stack.start(name, "gateway", *options, "--data-dir", str(stack.folder / name))


async def stored(folder: Path, url: str) -> list[StoredBatch]:
    """What the store has of the robot."""
    retention = Retention(age_s=86400, size_bytes=1 << 30)
    store = Store(folder, clock=SystemClock(), retention=retention, queue_bytes=1 << 20, url=url)
    store.start()
    try:
        assert await store.gaps("r", limit=10) == [], "nothing is declared lost"
        return await store.samples("r")
    finally:
        await store.close()


@pytest.mark.integration
async def test_from_one_gateway_to_the_other_and_back(
    tmp_path: Path, postgres: PostgresServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A gateway that hangs is tried by both transports before the other one; who is not answered waits longer each time.
    monkeypatch.setattr("edge_agent.uplink.uplink.OPEN_S", 0.5)
    url, ports, owner = postgres.schema(), [free_port(), free_port()], Owner()
    payloads: list[bytes] = []

    def more() -> None:
        fresh = [b"%06d" % number * 20 for number in range(len(payloads), len(payloads) + 500)]
        payloads.extend(fresh)
        feed(owner, uplink, fresh)

    with Stack(tmp_path) as stack:
        one, two = stack.at_once(
            lambda: start_gateway(stack, "one", url, ports[0]),
            lambda: start_gateway(stack, "two", url, ports[1]),
        )
        async with running(*(f"127.0.0.1:{port}" for port in ports), owner=owner) as (_, uplink):
            await wait(lambda: owner.ups == 1)
            more()
            await wait(lambda: owner.held == 0)
            more()
            one.process.send_signal(signal.SIGSTOP)  # it hangs, and will go on later as if nothing had been
            try:
                await wait(lambda: owner.ups == 2)
                assert owner.facts.gateway.endswith(str(ports[1]))
                more()
                await wait(lambda: owner.held == 0)
                more()
                two.kill()
            finally:
                one.process.send_signal(signal.SIGCONT)
            await wait(lambda: owner.ups == 3)
            assert owner.facts.gateway.endswith(str(ports[0]))
            more()
            await wait(lambda: owner.held == 0)
            one.kill()
            stack.restart(two)
            more()
            await wait(lambda: owner.ups == 4 and owner.held == 0)
    found = [payload for batch in await stored(tmp_path / "reader", url) for _, _, payload in batch.samples()]
    assert sorted(found) == sorted(payloads)
