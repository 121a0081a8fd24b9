"""`metaros up` whose ports are taken between its choice and the start of its processes.

Small programs stand in for the router and the gateway, of which a real one starts for seconds: they write the status
file, answer /readyz, and end as the real one does (tests/gateway/test_main.py) where a port is somebody else's.
"""

from __future__ import annotations

import asyncio
import socket
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest

from gateway import settings
from metaros.cli.shared.instances import DataDir, Instance, StateFile, open_data_dir, running_instances
from metaros.cli.shared.options import DEFAULT_ZENOH_PORT
from metaros.cli.up import launch_table, run
from metaros.cli.up import planning as up_decide
from metaros.cli.up.launch_table import Plan
from metaros.cli.up.planning import UpOptions
from metaros.cli.up.screen import Screen
from metaros.clock import SystemClock, system_rng
from metaros.errors import ConfigError, UnavailableError
from metaros.supervise import Launch
from tests.support.ports import free_port
from tests.support.waiting import wait_until_async

STAND_IN = """
import argparse, json, os, pathlib, socket, sys
parser = argparse.ArgumentParser()
parser.add_argument("--port", type=int)
parser.add_argument("--grpc-port", type=int)
parser.add_argument("--status-file", type=pathlib.Path)
said, _ = parser.parse_known_args()
opened = []
for port in filter(None, (said.port, said.grpc_port)):
    try:
        opened.append(socket.create_server(("127.0.0.1", port)))
    except OSError:
        sys.exit(bool(sys.stderr.write(f"error: port {port} cannot be opened: somebody has it\\n")) * 2)
said.status_file.write_text(json.dumps({"pid": os.getpid(), "ready": True}))
while True:
    asked, _ = opened[0].accept()
    well = asked.recv(65536).startswith(b"GET /readyz")
    asked.sendall(b"HTTP/1.1 %d .\\r\\nContent-Length: 0\\r\\n\\r\\n" % (200 if well else 404))
    asked.close()
"""


def stand_ins(plan: Plan) -> tuple[Launch, ...]:
    """The table of `metaros up` with small programs in it."""
    return tuple(
        replace(row, argv=(sys.executable, "-S", "-c", STAND_IN, *row.argv[3:])) for row in launch_table.launches(plan)
    )


@pytest.fixture
def start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., asyncio.Task[None]]]:
    """Starts `up` without robots; of each plan, the first `thefts` ones, somebody takes one port at once."""
    monkeypatch.setenv("METAROS_RUNTIME_DIR", str(tmp_path / "runtime"))
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setattr(up_decide, "HTTP_PORT", free_port())  # whether 8080 is free is not this test's business
    monkeypatch.setattr(up_decide, "GRPC_PORT", free_port())
    monkeypatch.setattr(run, "launches", stand_ins)
    with ExitStack() as taken:

        def started(port_of: Callable[[Plan], int], *, thefts: int) -> asyncio.Task[None]:
            left = iter(range(thefts))

            def make_plan(options: UpOptions, data: DataDir, screen: Screen, *, lost: Sequence[int]) -> Plan:
                plan = up_decide.make_plan(options, data, screen, lost=lost)
                if next(left, None) is not None:
                    thief = taken.enter_context(socket.socket())
                    thief.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                    thief.bind(("127.0.0.1", port_of(plan)))
                    thief.listen(8)
                return plan

            monkeypatch.setattr(run, "make_plan", make_plan)
            options = UpOptions(robots=0, host_robot=False, zenoh_port=free_port(), data_dir=tmp_path / "data")
            clock = SystemClock()
            return asyncio.create_task(run.run(options, Screen(clock=clock), clock=clock, rng=system_rng()))

        yield started


@pytest.mark.parametrize("port_of", [lambda plan: plan.http_port, lambda plan: plan.grpc_port], ids=["http", "grpc"])
async def test_a_port_that_is_taken_before_the_start_is_replaced(
    start: Callable[..., asyncio.Task[None]],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    port_of: Callable[[Plan], int],
) -> None:
    stops: list[Callable[[], None]] = []
    monkeypatch.setattr(run, "on_stop", lambda loop, ask, hangup: stops.append(ask))
    running = start(port_of, thefts=1)
    await wait_until_async(lambda: running.done() or [one.state for one in running_instances()] == ["ready"])
    stops[-1]()
    await running
    text = capsys.readouterr().out
    assert text.count("starting again with others") == 1
    assert text.count("Ready") == text.count("stopped") == 1
    assert len(stops) == 2
    assert running_instances() == []


async def test_whose_ports_are_taken_every_time_gives_up(
    start: Callable[..., asyncio.Task[None]], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(UnavailableError, match="gateway does not stay up"):
        await start(lambda plan: plan.http_port, thefts=99)
    assert capsys.readouterr().out.count("starting again with others") == run.STARTS - 1
    assert running_instances() == []


async def test_data_that_lie_remote_are_reported_before_anything_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("METAROS_RUNTIME_DIR", str(tmp_path / "runtime"))
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "share"))
    monkeypatch.setenv("HOME", str(tmp_path / "home"))

    def make_plan(options: UpOptions, data: DataDir, screen: Screen, *, lost: Sequence[int]) -> Plan:
        raise ConfigError(f"nothing to start in {data.path.name}")

    monkeypatch.setattr(run, "make_plan", make_plan)
    clock = SystemClock()
    first = open_data_dir(None)
    with pytest.raises(ConfigError, match="in instance-2"):
        await run.run(UpOptions(), Screen(clock=clock), clock=clock, rng=system_rng())
    said = f"another `metaros up` uses {first.path}: this one keeps its data in {first.path / 'instance-2'}"
    assert said in capsys.readouterr().out
    first.lock.close()


async def test_what_is_not_ready_in_time_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("METAROS_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr(run, "START_TIMEOUT_S", 0.0)
    clock = SystemClock()
    options = UpOptions(robots=0, host_robot=False, zenoh_port=free_port(), data_dir=tmp_path / "data")
    data = open_data_dir(options.data_dir)
    state = StateFile()
    plan = up_decide.make_plan(options, data, Screen(clock=clock), lost=[])
    claimed: Instance = run.claim(plan, clock)
    up = run._Up(plan, claimed, state, Screen(clock=clock), clock=clock, rng=system_rng(), lost=None)
    with pytest.raises(UnavailableError, match="the robots not ready after 0 s") as late:
        await up._step("the robots", lambda: False)
    assert f"logs: {plan.log_dir}" in str(late.value)
    state.close()
    data.lock.close()


def test_who_moves_takes_no_port_that_a_gateway_opens_by_itself() -> None:
    assert set(up_decide.KNOWN_PORTS) == {
        settings.DEFAULT_HTTP_PORT,
        settings.DEFAULT_GRPC_PORT,
        settings.DEFAULT_API_GRPC_PORT,
        settings.DEFAULT_FOXGLOVE_PORT,
        settings.DEFAULT_ROSBRIDGE_PORT,
        DEFAULT_ZENOH_PORT,
    }
