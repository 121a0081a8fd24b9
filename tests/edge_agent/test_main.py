"""The agent as a program: ready by its status file, clean end on a signal, one line for a wrong option."""

from __future__ import annotations

import asyncio
import json
import signal
import subprocess
import sys
from contextlib import AbstractContextManager
from pathlib import Path

import metaros
from edge_agent.config.settings import OutboxSettings, Settings
from edge_agent.main import run_agent
from edge_agent.outbox import OsDisk, Outbox
from edge_agent.state.state_dir import locked
from metaros.clock import SystemClock
from metaros.interfaces.std_msgs.msg import String
from metaros.link import CHANNEL_MASK
from tests.edge_agent.conftest import Rig, Robot
from tests.support.gateways.fake_gateway import FakeGateway
from tests.support.ports import free_port
from tests.support.processes.command_line import call_metaros
from tests.support.processes.processes import END_S, started
from tests.support.waiting import wait_until, wait_until_async

COMMAND = (
    "import typer; from edge_agent.cli.agent import register; app = typer.Typer(); app.callback()(lambda: None); "
    "register(app); app()"
)


def start(*options: str) -> AbstractContextManager[subprocess.Popen[str]]:
    return started([sys.executable, "-c", COMMAND, "agent", *options])


def test_it_is_ready_without_a_gateway_and_ends_cleanly(zenoh_router: str, tmp_path: Path) -> None:
    """By Ctrl-C; by SIGTERM in the test of `metaros agent status`."""
    status = tmp_path / "agent.json"
    gateway, port = f"127.0.0.1:{free_port()}", zenoh_router.rpartition(":")[2]
    options = ("--name", "r1", "--gateway", gateway, "--zenoh-port", port)
    places = ("--status-file", str(status), "--state-dir", str(tmp_path / "state"))
    with start(*options, *places) as agent:
        wait_until(lambda: status.exists() or agent.poll() is not None, timeout_s=60)
        assert json.loads(status.read_text()) == {"pid": agent.pid, "ready": True, "name": "r1", "namespace": "/"}
        agent.send_signal(signal.SIGINT)
        _, errors = agent.communicate(timeout=END_S)
        assert agent.returncode == 0, errors
        assert "Traceback" not in errors
        assert not status.exists()


def test_a_wrong_option_is_one_line() -> None:
    done = call_metaros("agent", "--gateway", "nowhere")
    assert done.code == 2
    assert done.err.startswith("metaros agent: command line: gateway must be HOST:PORT")
    assert done.err.strip().endswith("not 'nowhere'")
    assert len(done.err.strip().splitlines()) == 1


async def test_what_was_gathered_is_flushed_at_the_end(
    zenoh_router: str, gateway: FakeGateway, robot: Robot, tmp_path: Path
) -> None:
    settings = Settings(
        name="sim_1",
        namespace="/sim_1",
        gateway=gateway.target,
        zenoh_port=int(zenoh_router.rpartition(":")[2]),
        host_metrics=False,
        state_dir=tmp_path / "agent",
        outbox=OutboxSettings(bulk_sync_ms=10_000, reserve_bytes=65536),
    )
    publisher = robot.node.create_publisher(String, "log", metaros.qos_reliable_all)
    task = asyncio.create_task(run_agent(settings))
    rig = Rig(gateway)
    try:
        channel = await rig.wait_channel("/sim_1/log")
        await wait_until_async(lambda: publisher.events.matched)
        await asyncio.to_thread(lambda: [publisher.publish(String(data=str(number))) for number in range(50)])

        def seen() -> bool:
            reported = rig.half.statistics[-1].topics if rig.half.statistics else ()
            return any(rate.channel_id == channel.channel_id and rate.messages == 50 for rate in reported)

        await wait_until_async(seen)
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
    with locked(tmp_path / "agent"):
        outbox = Outbox(
            OsDisk(tmp_path / "agent" / "outbox"), SystemClock(), new_epoch=lambda: 1, writer="x", reserve_bytes=65536
        )
        held = [item.last_seq for item in outbox.ranges() if item.stream_id & CHANNEL_MASK == channel.channel_id]
    assert sum(held) == 50
