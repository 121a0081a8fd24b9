"""The desk with a real supervisor beside it, which it starts itself."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import signal
import sys
from collections.abc import AsyncIterator, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil
import pytest

from edge_agent.nodes.allowed import NodeSettings, allowed_entries
from edge_agent.nodes.desk import NodeDesk, crash_reports
from edge_agent.nodes.errors import NodeRefusedError, SupervisorError
from edge_agent.nodes.ledger import Ledger
from edge_agent.nodes.link import NodeLink
from edge_agent.nodes.rows import Place
from edge_agent.uplink.desk import Told
from metaros._proto import link_pb2
from metaros.clock import SystemClock
from metaros.errors import MetarosError
from metaros.supervise.client import ask
from metaros.supervise.program import running_pid
from metaros.twin import TwinError
from tests.support.waiting import wait_until_async

SLEEP = "import signal; print('up', flush=True); signal.sigwait([signal.SIGINT])"
MARK = "import os, sys; open(sys.argv[1], 'w').write(os.environ['METAROS_NODE'])"
CRASH = "import sys; sys.exit('broken')"
ALLOWED = [
    {"name": "sleep", "command": [sys.executable, "-S", "-c", SLEEP], "args": True},
    {"name": "crash", "command": [sys.executable, "-S", "-c", CRASH]},
    {"name": "wrong", "command": [sys.executable, "-S", "-c", "raise SystemExit(78)"]},
]


@dataclass
class OneBundle:
    folder: Path
    argv: tuple[str, ...]
    engine: str = ""
    image: str = ""


class FakeFetchError(MetarosError):
    """There is no such bundle."""

    code = "update_unknown"


class FakeBundles:
    """Version 1.0 sleeps, 2.0 crashes, 3.0 sleeps, 9.0 is not to be had."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.here: set[str] = set()
        self.well: list[str] = []
        self.kept: set[tuple[str, str]] = set()
        self.away = asyncio.Event()  # whoever asks for 4.0 waits for it

    def ready(self, name: str, version: str) -> OneBundle | None:
        code = CRASH if version == "2.0" else SLEEP
        folder = self.folder / name / version
        folder.mkdir(parents=True, exist_ok=True)
        if name == "box" and version in self.here:
            return OneBundle(folder, (), "/bin/podman", "sha256:1")
        return OneBundle(folder, (sys.executable, "-S", "-c", code)) if version in self.here else None

    async def get(self, name: str, version: str) -> OneBundle:
        if version == "9.0":
            raise FakeFetchError("no bundle 9.0")
        if version == "4.0":
            await self.away.wait()
        self.here.add(version)
        found = self.ready(name, version)
        assert found is not None
        return found

    def did_well(self, name: str, version: str) -> None:
        self.well.append(version)

    def collect(self, keep: Iterable[tuple[str, str]]) -> None:
        """Nothing goes."""
        self.kept = set(keep)


class Rig:
    """A robot's directory; agents come and go on it."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.bundles = FakeBundles(directory)
        self.desk = self.make()
        self._task: asyncio.Task[None] | None = None

    def make(self) -> NodeDesk:
        return NodeDesk(
            Ledger(self.directory),
            settings=NodeSettings(
                allowed=allowed_entries(ALLOWED, "test"),
                health_s=0.5,
                trial_s=60.0,
                safe_stop=(sys.executable, "-c", MARK, str(self.directory / "rest")),
            ),
            place=Place(namespace="/", zenoh_port=1),
            clock=SystemClock(),
            bundles=self.bundles,
        )

    async def start(self) -> None:
        self.link = NodeLink(self.desk)
        self.told: list[link_pb2.AgentFrame] = []
        self.link.link_up(self.told.append, link_pb2.Welcome())
        self._task = asyncio.create_task(self.link.run())

    async def stop(self) -> None:
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    async def again(self) -> None:
        """The agent is another process now."""
        await self.stop()
        self.desk = self.make()
        await self.start()

    def node(self, name: str) -> dict[str, Any]:
        return dict(self.desk.reported().get(name, {}))

    async def until(self, name: str, **wanted: object) -> dict[str, Any]:
        def so() -> bool:
            node = self.node(name)
            return all(node.get(key) == value for key, value in wanted.items())

        try:
            await wait_until_async(so)
        except AssertionError:
            raise AssertionError(f"{name} is {self.node(name)}, not {wanted}") from None
        return self.node(name)


@pytest.fixture
async def rig(tmp_path: Path) -> AsyncIterator[Rig]:
    rig = Rig(tmp_path)
    await rig.start()
    yield rig
    await rig.stop()
    with contextlib.suppress(MetarosError):
        await asyncio.to_thread(ask, tmp_path, "shutdown")
    await wait_until_async(lambda: running_pid(tmp_path) is None)


async def test_without_nodes_there_is_no_supervisor(rig: Rig) -> None:
    await rig.desk.set_nodes({})
    with pytest.raises(SupervisorError):
        await rig.desk.verb("a", "stop")
    assert running_pid(rig.directory) is None
    assert rig.desk.reported() == {}


async def test_what_is_wanted_runs_and_outlives_the_agent(rig: Rig) -> None:
    await rig.desk.set_nodes({"a": {"allowed": "sleep"}, "b": {"allowed": "sleep", "run": False}})
    pid = (await rig.until("a", state="running"))["pid"]
    assert rig.node("b")["state"] == "stopped"
    supervisor = running_pid(rig.directory)
    assert supervisor is not None
    assert os.getsid(supervisor) == supervisor  # a session of its own
    await rig.again()
    assert (await rig.until("a", state="running"))["pid"] == pid  # also before anybody says what is wanted
    await rig.desk.set_nodes({"a": {"allowed": "sleep"}, "c": {"allowed": "sleep"}})
    await rig.until("c", state="running")
    assert rig.node("a")["pid"] == pid
    assert rig.node("b") == {}


async def test_a_killed_supervisor_comes_back_with_its_nodes(rig: Rig) -> None:
    await rig.desk.set_nodes({"a": {"allowed": "sleep"}})
    pid = (await rig.until("a", state="running"))["pid"]
    supervisor = running_pid(rig.directory)
    assert supervisor is not None
    os.kill(supervisor, signal.SIGKILL)
    await wait_until_async(lambda: not psutil.pid_exists(pid))
    await wait_until_async(lambda: running_pid(rig.directory) not in (None, supervisor))
    await wait_until_async(lambda: rig.node("a").get("pid") not in (None, pid))


async def test_stopped_by_hand_it_stays_down(rig: Rig) -> None:
    await rig.desk.set_nodes({"a": {"allowed": "sleep"}})
    await rig.until("a", state="running")
    await asyncio.to_thread(ask, rig.directory, "shutdown")
    await rig.until("a", state="stopped", why="the supervisor was stopped by hand")
    with pytest.raises(SupervisorError, match="stopped by hand"):
        await rig.desk.verb("a", "start")


async def test_a_refused_table_changes_nothing(rig: Rig) -> None:
    await rig.desk.set_nodes({"a": {"allowed": "sleep"}})
    pid = (await rig.until("a", state="running"))["pid"]
    with pytest.raises(NodeRefusedError, match="free commands"):
        await rig.desk.set_nodes({"x": {"command": ["sh"]}})
    with pytest.raises(TwinError, match="circle"):
        await rig.desk.set_nodes({"x": {"allowed": "sleep", "after": ["y"]}, "y": {"allowed": "sleep", "after": ["x"]}})
    await rig.again()
    assert (await rig.until("a", state="running"))["pid"] == pid


async def test_verbs_and_logs(rig: Rig) -> None:
    await rig.desk.set_nodes({"a": {"allowed": "sleep"}})
    pid = (await rig.until("a", state="running"))["pid"]
    await rig.desk.verb("a", "restart")
    await wait_until_async(lambda: rig.node("a").get("pid") not in (None, pid))
    await rig.desk.verb("a", "stop")
    await rig.until("a", state="stopped", why="by hand")
    await rig.desk.verb("a", "start")
    await rig.until("a", state="running")
    with pytest.raises(MetarosError, match="no verb"):
        await rig.desk.verb("a", "shutdown")
    with pytest.raises(SupervisorError, match="no node 'b'"):
        await rig.desk.verb("b", "start")
    await wait_until_async(lambda: b" up\n" in (rig.directory / "logs" / "a.log").read_bytes())
    page = json.loads(await rig.desk.read_log("a", query="up"))
    assert "up" in [line["text"] for line in page["lines"]]
    assert set(page) == {"lines", "cursor", "more"}


async def test_the_commands_of_the_link(rig: Rig) -> None:
    await rig.desk.set_nodes({"a": {"allowed": "sleep"}})
    await rig.until("a", state="running")
    await wait_until_async(lambda: b" up\n" in (rig.directory / "logs" / "a.log").read_bytes())
    verb = link_pb2.Command(node_verb=link_pb2.NodeVerb(node="a", verb="signal", signal=int(signal.SIGKILL)))
    assert await rig.link.actions["node_verb"](verb, 30.0) == b""
    await rig.until("a", last_exit="killed by SIGKILL")
    log = link_pb2.Command(read_log=link_pb2.ReadLog(node="a", max_bytes=1000, backwards=True))
    assert json.loads(await rig.link.actions["read_log"](log, 30.0))["lines"]


async def test_crashes_are_seen(rig: Rig) -> None:
    await rig.desk.set_nodes({"bad": {"allowed": "crash"}, "good": {"allowed": "sleep"}})
    await wait_until_async(lambda: rig.node("bad").get("crashes", 0) >= 3)
    assert rig.node("bad")["last_exit"] == "exit code 1"
    assert rig.node("bad")["quarantined"] is False
    await rig.until("good", state="running", crashes=0)
    verb = link_pb2.Command(node_verb=link_pb2.NodeVerb(node="bad", verb="crashes"))
    reports = json.loads(await rig.link.actions["node_verb"](verb, 30.0))["crashes"]
    assert (reports[0]["reason"], reports[0]["lines"]) == ("exit code 1: broken", ["broken"])
    assert [report["at_ns"] for report in reports] == sorted(report["at_ns"] for report in reports)


async def test_the_robots_own_settings_say_how_it_comes_to_rest(rig: Rig) -> None:
    await rig.desk.set_nodes({"arm": {"allowed": "wrong", "critical": True}, "lamp": {"allowed": "wrong"}})
    await rig.until("arm", state="ended", safe_stop="done")
    assert (rig.directory / "rest").read_text() == "arm"
    assert "safe_stop" not in await rig.until("lamp", state="ended")


def test_reports_that_are_too_long_lose_the_oldest() -> None:
    reports = [{"at_ns": number, "lines": ["ä" * 100]} for number in range(10)]
    kept = json.loads(crash_reports(reports, most_bytes=1000))["crashes"]
    assert 0 < len(kept) < 10
    assert kept == reports[-len(kept) :]
    assert json.loads(crash_reports(reports, most_bytes=1))["crashes"] == []


# -- bundles -----------------------------------------------------------------------------------------------------------


async def test_a_bundle_comes_runs_and_proves_itself(rig: Rig) -> None:
    await rig.desk.set_nodes({"a": {"bundle": "b", "version": "1.0"}})
    found = await rig.until("a", state="running", version="1.0")
    await wait_until_async(lambda: rig.node("a")["update"]["state"] == "healthy")
    assert rig.bundles.well == ["1.0"]
    await rig.desk.set_nodes({"a": {"bundle": "b", "version": "9.0"}})
    await wait_until_async(lambda: rig.node("a")["update"]["state"] == "refused")
    assert rig.node("a")["update"]["code"] == "update_unknown"
    assert rig.node("a")["pid"] == found["pid"]  # the old one serves on
    await rig.desk.set_nodes({"a": {"bundle": "b", "version": "3.0"}})
    await wait_until_async(lambda: rig.bundles.kept == {("b", "1.0"), ("b", "3.0")})  # while 3.0 is on trial
    await wait_until_async(lambda: rig.bundles.kept == {("b", "3.0")})


async def test_the_old_version_serves_on_while_another_agent_fetches_the_new_one(rig: Rig) -> None:
    await rig.desk.set_nodes({"a": {"bundle": "b", "version": "1.0"}})
    pid = (await rig.until("a", state="running", version="1.0"))["pid"]
    await rig.again()
    await rig.desk.set_nodes({"a": {"bundle": "b", "version": "4.0"}, "c": {"allowed": "sleep"}})
    await rig.until("c", state="running")
    assert rig.node("a")["pid"] == pid
    await wait_until_async(lambda: rig.node("a")["update"]["state"] == "downloading")
    assert rig.node("a")["pid"] == pid
    rig.bundles.away.set()
    await rig.until("a", state="running", version="4.0")


async def test_a_container_that_may_not_run_is_one_nodes_problem(rig: Rig) -> None:
    await rig.desk.set_nodes({"a": {"bundle": "box", "version": "5.0", "migratable": True}, "c": {"allowed": "sleep"}})
    await rig.until("c", state="running")
    await rig.until("a", state="refused")
    assert rig.node("a")["update"]["code"] == "node_not_allowed"
    assert "cannot be migratable" in rig.node("a")["update"]["message"]


async def test_a_broken_version_goes_back_by_itself_and_is_told(rig: Rig) -> None:
    await rig.desk.set_nodes({"a": {"bundle": "b", "version": "1.0"}})
    await wait_until_async(lambda: rig.node("a").get("update", {}).get("state") == "healthy")
    await rig.desk.set_nodes({"a": {"bundle": "b", "version": "2.0"}})
    await wait_until_async(lambda: rig.node("a")["update"]["state"] == "rolled_back")
    await rig.until("a", state="running", version="1.0")
    assert rig.node("a")["update"]["version"] == "2.0"
    await rig.again()  # nor is it tried again by another agent
    await rig.desk.set_nodes({"a": {"bundle": "b", "version": "2.0"}})
    await rig.until("a", state="running", version="1.0")
    assert rig.node("a")["update"]["state"] == "rolled_back"
    await rig.desk.set_nodes({"a": {"bundle": "b", "version": "3.0"}})
    await rig.until("a", state="running", version="3.0")


# -- leases ------------------------------------------------------------------------------------------------------------


def leases(since_ns: int, *rows: tuple[str, int]) -> Told:
    frame = link_pb2.NodeLeases(
        since_ns=since_ns,
        leases=[link_pb2.NodeLease(node=node, lease_id="x", valid_ms=valid_ms, epoch=7) for node, valid_ms in rows],
    )
    return Told(link_pb2.GatewayFrame(node_leases=frame), SystemClock().monotonic_s())


def moment_of(rig: Rig) -> int:
    """A question of the gateway's, and the moment that is its answer."""
    rig.link.take(leases(0))
    return rig.told[-1].leases_taken.boot_ns


async def test_a_lease_that_nobody_renews_ends_with_agent_and_link_dead(rig: Rig) -> None:
    await rig.desk.set_nodes({"m": {"allowed": "sleep", "migratable": True}})
    await rig.until("m", state="stopped", why="no lease")
    first = moment_of(rig)
    rig.link.take(leases(first, ("m", 60_000)))
    pid = (await rig.until("m", state="running"))["pid"]
    rig.link.take(leases(moment_of(rig), ("m", 61_000)))
    assert psutil.Process(pid).environ()["METAROS_LEASE_EPOCH"] == "7"
    rig.link.take(leases(moment_of(rig), ("m", 3_000)))
    rig.link.take(leases(first, ("m", 60_000)))  # it was long on its way: the newer word holds
    await rig.again()
    await rig.stop()  # the agent is gone, and with it the link
    await wait_until_async(lambda: not psutil.pid_exists(pid))


async def test_a_frame_that_lay_in_a_buffer_gives_nothing(rig: Rig) -> None:
    await rig.desk.set_nodes({"m": {"allowed": "sleep", "migratable": True}, "a": {"allowed": "sleep"}})
    await rig.until("m", why="no lease")
    moment = moment_of(rig)
    rig.link.take(leases(moment, ("m", 1)))  # it is over when it comes
    rig.link.take(leases(moment - 10**9, ("m", 60_000)))  # told over another link, before
    rig.link.take(leases(moment + 10**12, ("m", 60_000)))  # or of the machine before it started again
    rig.link.take(leases(0, ("m", 60_000)))
    assert len(rig.told) == 5  # each of them is answered
    rig.link.link_down()
    rig.link.take(leases(moment, ("m", 60_000)))  # the link that it was told over is gone
    await rig.desk.verb("a", "restart")  # goes the same way, after them
    await rig.until("a", state="running")
    assert rig.node("m")["why"] == "no lease"
