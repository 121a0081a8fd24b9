"""The desk with a real supervisor beside it, which it starts itself; tests that neither end nor kill it share one."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import signal
import sys
from collections.abc import AsyncIterator, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil
import pytest

from edge_agent.config.node_settings import NodeSettings, allowed_entries
from edge_agent.link.frames import ControlFrame
from edge_agent.nodes.errors import NodeRefusedError, SupervisorError
from edge_agent.nodes.launch_row import LaunchContext
from edge_agent.nodes.ledger import Ledger
from edge_agent.nodes.link_handler import NodeLinkHandler
from edge_agent.nodes.manager import NodeManager, crash_reports
from metaros._proto import link_pb2
from metaros.clock import ManualClock, SystemClock
from metaros.errors import MetarosError
from metaros.fleet.twin import TwinError
from metaros.supervise.client import ask
from metaros.supervise.program import running_pid
from tests.support.processes.processes import alive
from tests.support.waiting import wait_until, wait_until_async

SLEEP = """
import os, signal
signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
print(f"up {os.getpid()}", flush=True)
signal.sigwait([signal.SIGINT])
"""
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
        self._logged = {log.name: log.stat().st_size for log in directory.glob("logs/*.log")}  # by tests before
        self.clock = ManualClock(wall_ns=SystemClock().wall_ns())  # a version has run well once a test says so
        self.manager = self.make()
        self._task: asyncio.Task[None] | None = None

    def make(self) -> NodeManager:
        return NodeManager(
            Ledger(self.directory),
            settings=NodeSettings(
                allowed=allowed_entries(ALLOWED, "test"),
                health_s=0.2,
                trial_s=3600.0,
                safe_stop=(sys.executable, "-S", "-c", MARK, str(self.directory / "rest")),
            ),
            place=LaunchContext(namespace="/", zenoh_port=1),
            clock=self.clock,
            bundles=self.bundles,
        )

    async def start(self) -> None:
        self.link = NodeLinkHandler(self.manager)
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
        self.manager = self.make()
        await self.start()

    def node(self, name: str) -> dict[str, Any]:
        return dict(self.manager.reported().get(name, {}))

    async def until(self, name: str, **wanted: object) -> dict[str, Any]:
        def so() -> bool:
            node = self.node(name)
            return all(node.get(key) == value for key, value in wanted.items())

        try:
            await wait_until_async(so)
        except AssertionError:
            raise AssertionError(f"{name} is {self.node(name)}, not {wanted}") from None
        return self.node(name)

    async def proves_itself(self, name: str) -> None:
        """Time passes until the version that runs is a good one."""

        def so() -> bool:
            self.clock.advance(1.0)
            return bool(self.node(name)["update"]["state"] == "healthy")

        await self.until(name, state="running")
        await wait_until_async(so)

    async def up(self, name: str) -> int:
        """The process of a node that sleeps and may be asked to end; one that is just starting may not hear it.

        A row that is there again while its process of before still ends shows that one: its words do not count.
        """
        log = self.directory / "logs" / f"{name}.log"
        old_bytes = self._logged.get(log.name, 0)

        def so() -> bool:
            pid = self.node(name).get("pid")
            return pid is not None and log.exists() and f" up {pid}\n".encode() in log.read_bytes()[old_bytes:]

        await wait_until_async(so)
        return int(self.node(name)["pid"])


@pytest.fixture
async def rig(tmp_path: Path) -> AsyncIterator[Rig]:
    """With a directory of its own, where no supervisor runs yet."""
    rig = Rig(tmp_path)
    await rig.start()
    yield rig
    await rig.stop()
    await asyncio.to_thread(no_supervisor, tmp_path)


@pytest.fixture(scope="module")
def directory(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """What the tests with `shared` share; the first of them starts the supervisor."""
    directory = tmp_path_factory.mktemp("robot")
    yield directory
    no_supervisor(directory)


@pytest.fixture
async def shared(directory: Path) -> AsyncIterator[Rig]:
    """On the directory of all; a bundle's trials stay on it, so each test with bundles has a name of its own."""
    rig = Rig(directory)
    await rig.start()
    yield rig
    await rig.manager.set_nodes({})
    await wait_until_async(lambda: not rig.manager.reported())
    await rig.stop()


def no_supervisor(directory: Path) -> None:
    """End the one of this directory."""
    with contextlib.suppress(MetarosError):
        ask(directory, "shutdown")
    wait_until(lambda: running_pid(directory) is None)


async def test_without_nodes_there_is_no_supervisor(rig: Rig) -> None:
    await rig.manager.set_nodes({})
    with pytest.raises(SupervisorError):
        await rig.manager.verb("a", "stop")
    assert running_pid(rig.directory) is None
    assert rig.manager.reported() == {}


async def test_what_is_wanted_runs_and_outlives_the_agent(rig: Rig) -> None:
    await rig.manager.set_nodes({"a": {"allowed": "sleep"}, "b": {"allowed": "sleep", "run": False}})
    assert not rig.manager.handed_over
    await wait_until_async(lambda: rig.manager.handed_over)
    await rig.manager.set_nodes({"a": {"allowed": "sleep"}, "b": {"allowed": "sleep", "run": False}})
    assert rig.manager.handed_over  # the same again, as with a twin that changes something else
    assert rig.node("a")["state"] in ("starting", "running")
    pid = (await rig.until("a", state="running"))["pid"]
    assert rig.node("b")["state"] == "stopped"
    supervisor = running_pid(rig.directory)
    assert supervisor is not None
    assert os.getsid(supervisor) == supervisor  # a session of its own
    await rig.again()
    assert (await rig.until("a", state="running"))["pid"] == pid  # also before anybody says what is wanted
    await rig.manager.set_nodes({"a": {"allowed": "sleep"}, "c": {"allowed": "sleep"}})
    await rig.until("c", state="running")
    assert rig.node("a")["pid"] == pid
    assert rig.node("b") == {}


@pytest.mark.integration
async def test_a_killed_supervisor_comes_back_with_its_nodes(rig: Rig) -> None:
    await rig.manager.set_nodes({"a": {"allowed": "sleep"}})
    pid = (await rig.until("a", state="running"))["pid"]
    supervisor = running_pid(rig.directory)
    assert supervisor is not None
    os.kill(supervisor, signal.SIGKILL)
    await wait_until_async(lambda: not alive(pid))
    await wait_until_async(lambda: running_pid(rig.directory) not in (None, supervisor))
    await wait_until_async(lambda: rig.node("a").get("pid") not in (None, pid))


async def test_stopped_by_hand_it_stays_down(rig: Rig) -> None:
    await rig.manager.set_nodes({"a": {"allowed": "sleep"}})
    await rig.until("a", state="running")
    await asyncio.to_thread(ask, rig.directory, "shutdown")
    await rig.until("a", state="stopped", why="the supervisor was stopped by hand")
    with pytest.raises(SupervisorError, match="stopped by hand"):
        await rig.manager.verb("a", "start")


async def test_a_refused_table_changes_nothing(shared: Rig) -> None:
    await shared.manager.set_nodes({"a": {"allowed": "sleep"}})
    pid = (await shared.until("a", state="running"))["pid"]
    with pytest.raises(NodeRefusedError, match="free commands"):
        await shared.manager.set_nodes({"x": {"command": ["sh"]}})
    with pytest.raises(TwinError, match="circle"):
        await shared.manager.set_nodes(
            {"x": {"allowed": "sleep", "after": ["y"]}, "y": {"allowed": "sleep", "after": ["x"]}}
        )
    await shared.again()
    assert (await shared.until("a", state="running"))["pid"] == pid


async def test_verbs_and_logs(shared: Rig) -> None:
    await shared.manager.set_nodes({"a": {"allowed": "sleep"}})
    pid = await shared.up("a")
    await shared.manager.verb("a", "restart")
    await wait_until_async(lambda: shared.node("a").get("pid") not in (None, pid))
    await shared.up("a")
    await shared.manager.verb("a", "stop")
    await shared.until("a", state="stopped", why="by hand")
    await shared.manager.verb("a", "start")
    await shared.until("a", state="running")
    with pytest.raises(MetarosError, match="no verb"):
        await shared.manager.verb("a", "shutdown")
    with pytest.raises(SupervisorError, match="no node 'b'"):
        await shared.manager.verb("b", "start")
    pid = await shared.up("a")
    page = json.loads(await shared.manager.read_log("a", query="up"))
    assert f"up {pid}" in [line["text"] for line in page["lines"]]
    assert set(page) == {"lines", "cursor", "more"}


async def test_the_commands_of_the_link(shared: Rig) -> None:
    await shared.manager.set_nodes({"a": {"allowed": "sleep"}})
    await shared.up("a")
    verb = link_pb2.Command(node_verb=link_pb2.NodeVerb(node="a", verb="signal", signal=int(signal.SIGKILL)))
    assert await shared.link.actions["node_verb"](verb, 30.0) == b""
    await shared.until("a", last_exit="killed by SIGKILL")
    log = link_pb2.Command(read_log=link_pb2.ReadLog(node="a", max_bytes=1000, backwards=True))
    assert json.loads(await shared.link.actions["read_log"](log, 30.0))["lines"]


async def test_crashes_are_seen(shared: Rig) -> None:
    await shared.manager.set_nodes({"bad": {"allowed": "crash"}, "good": {"allowed": "sleep"}})
    await wait_until_async(lambda: shared.node("bad").get("crashes", 0) >= 3)
    assert shared.node("bad")["last_exit"] == "exit code 1"
    assert shared.node("bad")["quarantined"] is False
    await shared.until("good", state="running", crashes=0)
    verb = link_pb2.Command(node_verb=link_pb2.NodeVerb(node="bad", verb="crashes"))
    reports = json.loads(await shared.link.actions["node_verb"](verb, 30.0))["crashes"]
    assert (reports[0]["reason"], reports[0]["lines"]) == ("exit code 1: broken", ["broken"])
    assert [report["at_ns"] for report in reports] == sorted(report["at_ns"] for report in reports)


async def test_the_robots_own_settings_say_how_it_comes_to_rest(shared: Rig) -> None:
    await shared.manager.set_nodes({"arm": {"allowed": "wrong", "critical": True}, "lamp": {"allowed": "wrong"}})
    await shared.until("arm", state="ended", safe_stop="done")
    assert (shared.directory / "rest").read_text() == "arm"
    assert "safe_stop" not in await shared.until("lamp", state="ended")


def test_reports_that_are_too_long_lose_the_oldest() -> None:
    reports = [{"at_ns": number, "lines": ["ä" * 100]} for number in range(10)]
    kept = json.loads(crash_reports(reports, most_bytes=1000))["crashes"]
    assert 0 < len(kept) < 10
    assert kept == reports[-len(kept) :]
    assert json.loads(crash_reports(reports, most_bytes=1))["crashes"] == []


# -- bundles -----------------------------------------------------------------------------------------------------------


async def test_a_bundle_comes_runs_and_proves_itself(shared: Rig) -> None:
    await shared.manager.set_nodes({"new": {"bundle": "b", "version": "1.0"}})
    found = await shared.until("new", state="running", version="1.0")
    await shared.proves_itself("new")
    assert shared.bundles.well == ["1.0"]
    await shared.manager.set_nodes({"new": {"bundle": "b", "version": "9.0"}})
    await wait_until_async(lambda: shared.node("new")["update"]["state"] == "refused")
    assert shared.node("new")["update"]["code"] == "update_unknown"
    assert shared.node("new")["pid"] == found["pid"]  # the old one serves on
    await shared.manager.set_nodes({"new": {"bundle": "b", "version": "3.0"}})
    await wait_until_async(lambda: shared.bundles.kept == {("b", "1.0"), ("b", "3.0")})  # while 3.0 is on trial
    await shared.proves_itself("new")
    await wait_until_async(lambda: shared.bundles.kept == {("b", "3.0")})


async def test_the_old_version_serves_on_while_another_agent_fetches_the_new_one(shared: Rig) -> None:
    await shared.manager.set_nodes({"old": {"bundle": "b", "version": "1.0"}})
    pid = (await shared.until("old", state="running", version="1.0"))["pid"]
    await shared.again()
    await shared.manager.set_nodes({"old": {"bundle": "b", "version": "4.0"}, "c": {"allowed": "sleep"}})
    await shared.until("c", state="running")
    assert shared.node("old")["pid"] == pid
    await wait_until_async(lambda: shared.node("old")["update"]["state"] == "downloading")
    assert shared.node("old")["pid"] == pid
    await shared.manager.set_nodes({"old": {"bundle": "b", "version": "4.0"}})
    assert shared.manager.handed_over  # a download may take longer than a twin's trial, which does not wait for it
    shared.bundles.away.set()
    await shared.until("old", state="running", version="4.0")


async def test_a_container_that_may_not_run_is_one_nodes_problem(shared: Rig) -> None:
    box = {"bundle": "box", "version": "5.0", "migratable": True}
    await shared.manager.set_nodes({"box": box, "c": {"allowed": "sleep"}})
    await shared.until("c", state="running")
    await shared.until("box", state="refused")
    assert shared.node("box")["update"]["code"] == "node_not_allowed"
    assert "cannot be migratable" in shared.node("box")["update"]["message"]


async def test_a_broken_version_goes_back_by_itself_and_is_reported(shared: Rig) -> None:
    await shared.manager.set_nodes({"bad": {"bundle": "b", "version": "1.0"}})
    await shared.until("bad", state="running", version="1.0")
    await shared.proves_itself("bad")
    await shared.manager.set_nodes({"bad": {"bundle": "b", "version": "2.0"}})
    await wait_until_async(lambda: shared.node("bad")["update"]["state"] == "rolled_back")
    await shared.until("bad", state="running", version="1.0")
    assert shared.node("bad")["update"]["version"] == "2.0"
    await shared.again()  # nor is it tried again by another agent
    await shared.manager.set_nodes({"bad": {"bundle": "b", "version": "2.0"}})
    await shared.until("bad", state="running", version="1.0")
    assert shared.node("bad")["update"]["state"] == "rolled_back"
    await shared.manager.set_nodes({"bad": {"bundle": "b", "version": "3.0"}})
    await shared.until("bad", state="running", version="3.0")


async def test_others_may_be_wanted_while_the_supervisor_is_asked(shared: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    ask_it = shared.manager.line.ask

    async def and_change(verb: str, **request: Any) -> dict[str, Any]:
        found = await ask_it(verb, **request)
        if [row["name"] for row in request.get("rows", [])] == ["gone"]:
            await shared.manager.set_nodes({"c": {"allowed": "sleep"}})
        return found

    monkeypatch.setattr(shared.manager.line, "ask", and_change)
    await shared.manager.set_nodes({"gone": {"bundle": "b", "version": "1.0"}})
    await shared.until("c", state="running")
    assert shared.node("gone") == {}


# -- leases ------------------------------------------------------------------------------------------------------------


def leases(since_ns: int, *rows: tuple[str, int], lease_id: str = "x") -> ControlFrame:
    given = [link_pb2.NodeLease(node=node, lease_id=lease_id, valid_ms=valid_ms, epoch=7) for node, valid_ms in rows]
    frame = link_pb2.NodeLeases(since_ns=since_ns, leases=given)
    return ControlFrame(link_pb2.GatewayFrame(node_leases=frame), SystemClock().monotonic_s())


def moment_of(rig: Rig) -> int:
    """A question of the gateway's, and the moment that is its answer."""
    rig.link.take(leases(0))
    return rig.told[-1].leases_taken.boot_ns


async def test_a_lease_that_nobody_renews_ends_with_agent_and_link_dead(shared: Rig) -> None:
    await shared.manager.set_nodes({"m": {"allowed": "sleep", "migratable": True}, "other": {"allowed": "sleep"}})
    await shared.until("m", state="stopped", why="no lease")
    await shared.up("other")
    first = moment_of(shared)
    shared.link.take(leases(first, ("m", 60_000)))
    pid = await shared.up("m")
    assert psutil.Process(pid).environ()["METAROS_LEASE_EPOCH"] == "7"
    shared.link.take(leases(moment_of(shared), ("m", 1_500), lease_id="y"))
    await shared.until("m", lease_id="y")
    shared.link.take(leases(first, ("m", 60_000), lease_id="z"))  # it was long on its way: the newer word holds
    await shared.manager.verb("other", "restart")  # goes the same way, after it
    await shared.again()
    await shared.stop()  # the agent is gone, and with it the link
    await wait_until_async(lambda: not alive(pid), timeout_s=30.0)  # not after a minute


async def test_a_frame_that_lay_in_a_buffer_gives_nothing(shared: Rig) -> None:
    await shared.manager.set_nodes({"m": {"allowed": "sleep", "migratable": True}, "a": {"allowed": "sleep"}})
    await shared.until("m", why="no lease")
    moment = moment_of(shared)
    shared.link.take(leases(moment, ("m", 1)))  # it is over when it comes
    shared.link.take(leases(moment - 10**9, ("m", 60_000)))  # told over another link, before
    shared.link.take(leases(moment + 10**12, ("m", 60_000)))  # or of the machine before it started again
    shared.link.take(leases(0, ("m", 60_000)))
    assert len(shared.told) == 5  # each of them is answered
    shared.link.link_down()
    shared.link.take(leases(moment, ("m", 60_000)))  # the link that it was told over is gone
    await shared.manager.verb("a", "restart")  # goes the same way, after them
    await shared.until("a", state="running")
    assert shared.node("m")["why"] == "no lease"


async def test_what_is_not_to_be_had_is_asked_for_ever_more_seldom(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    manager, timeout = Rig(tmp_path).manager, asyncio.timeout
    waits: list[float | None] = []
    all_passed = asyncio.Event()

    def passing(wait_s: float | None) -> asyncio.Timeout:
        """Each wait is over at once, but for the last two."""
        waits.append(wait_s)
        if len(waits) >= 9:
            all_passed.set()
        return timeout(0.0 if 1 < len(waits) < 9 else None)

    monkeypatch.setattr(asyncio, "timeout", passing)
    await manager.set_nodes({"n": {"bundle": "b", "version": "9.0"}})
    keeping = asyncio.create_task(manager._keep())
    await all_passed.wait()
    all_passed.clear()
    await manager.set_nodes({"n": {"bundle": "b", "version": "9.0"}})
    await all_passed.wait()
    keeping.cancel()
    await asyncio.gather(keeping, return_exceptions=True)
    assert waits == [None, 5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 300.0, 300.0, 5.0]  # told anew, it begins anew
