"""Dependencies, requests and hangs: the supervisor with real, small children."""

from __future__ import annotations

import sys
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from metaros.clock import SystemClock, system_rng
from metaros.errors import UnavailableError
from metaros.supervise import Event, EventKind, Launch, RestartPolicy, Supervisor
from metaros.supervise.restart_policy import Restart
from tests.support.nodes.node_code import SLEEP
from tests.support.waiting import wait_until_async

BEAT_ONCE = """
import os, signal, socket
signal.signal(signal.SIGTERM, {term})
host, port, token, period = os.environ["METAROS_HEARTBEAT"].split(":")
socket.socket(socket.AF_INET, socket.SOCK_DGRAM).sendto(f"{{token}} +1".encode(), (host, int(port)))
signal.pause()
"""
_SOON_S = 60.0


class Rig:
    """A supervisor, its events, and launches of Python one-liners."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.events: list[Event] = []
        self.ready: set[str] = set()
        self.lines: list[tuple[str, str]] = []
        self.supervisor = Supervisor(
            clock=SystemClock(),
            rng=system_rng(),
            on_event=self.events.append,
            on_line=lambda name, text: self.lines.append((name, text)),
            is_ready=self.ready.__contains__,
        )

    def start(self, *launches: Launch) -> None:
        self.supervisor.start(launches)

    def launch(self, name: str, code: str = SLEEP, **options: object) -> Launch:
        argv = (sys.executable, "-S", "-c", code)
        return Launch(name=name, argv=argv, log_path=self.folder / f"{name}.log", **options)  # type: ignore[arg-type]

    def count(self, name: str, kind: EventKind) -> int:
        return sum(event.name == name and event.kind is kind for event in self.events)

    def state(self, name: str) -> str:
        (state,) = (row.state for row in self.supervisor.status() if row.name == name)
        return state

    def kill(self, name: str) -> None:
        child = self.supervisor._children[name]
        assert child.process is not None
        child.process.kill()

    async def up(self, name: str, times: int = 1) -> None:
        await wait_until_async(lambda: self.lines.count((name, "up")) >= times, timeout_s=_SOON_S)


@pytest.fixture
async def rig(tmp_path: Path) -> AsyncIterator[Rig]:
    rig = Rig(tmp_path)
    yield rig
    await rig.supervisor.stop(grace_s=1.0)


async def test_a_consumer_starts_when_its_driver_is_ready(rig: Rig) -> None:
    rig.start(rig.launch("consumer", after=("driver",)), rig.launch("driver"))
    await rig.up("driver")
    (status,) = (row for row in rig.supervisor.status() if row.name == "consumer")
    assert (status.state, status.waits_for, status.pid) == ("blocked", "driver", None)
    rig.ready.add("driver")
    await rig.up("consumer")
    kinds = [(event.name, event.kind) for event in rig.events]
    assert kinds.index(("driver", EventKind.READY)) < kinds.index(("consumer", EventKind.STARTED))


async def test_rest_for_one_takes_the_consumers_along_and_nobody_else(rig: Rig) -> None:
    rig.ready.update("abcd")
    rig.start(
        rig.launch("a"),
        rig.launch("b", after=("a",), rest_for_one=True),
        rig.launch("c", after=("b",), rest_for_one=True),
        rig.launch("d", after=("a",)),
    )
    for name in "abcd":
        await rig.up(name)
    rig.kill("a")
    for name in "abc":
        await rig.up(name, 2)
    reasons = {event.name: event.detail for event in rig.events if event.kind is EventKind.RESTARTING}
    assert reasons == {"a": "killed by SIGKILL", "b": "a restarted", "c": "b restarted"}
    assert rig.lines.count(("d", "up")) == 1
    assert not any(event.kind is EventKind.EXITED for event in rig.events if event.name != "a")


async def test_what_is_done_lets_the_next_begin(rig: Rig) -> None:
    rig.ready.add("setup")
    once = RestartPolicy(restart=Restart.NEVER)
    rig.start(rig.launch("setup", "", policy=once), rig.launch("node", after=("setup",)))
    await rig.up("node")


async def test_restart_ends_it_and_starts_it_again_without_blame(rig: Rig) -> None:
    rig.start(rig.launch("a"))
    await rig.up("a")
    rig.supervisor.restart("a")
    await rig.up("a", 2)
    assert rig.count("a", EventKind.EXITED) == 0
    assert [row.restarts for row in rig.supervisor.status()] == [1]


async def test_restart_ends_a_quarantine(rig: Rig) -> None:
    rig.start(rig.launch("a", "raise SystemExit(1)", policy=RestartPolicy(window_exits=0)))
    await wait_until_async(lambda: rig.state("a") == "quarantined", timeout_s=_SOON_S)
    rig.supervisor.restart("a")
    await wait_until_async(lambda: rig.count("a", EventKind.QUARANTINED) == 2, timeout_s=_SOON_S)


async def test_stop_one_leaves_it_so_until_restart(rig: Rig) -> None:
    rig.start(rig.launch("a"), rig.launch("b"))
    await rig.up("a")
    await rig.up("b")
    await rig.supervisor.stop_one("a")
    assert (rig.state("a"), rig.state("b")) == ("stopped", "running")
    rig.supervisor.restart("a")
    await rig.up("a", 2)
    with pytest.raises(UnavailableError, match="no process 'c' here; there are: a, b"):
        rig.supervisor.restart("c")


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize("term", ["signal.SIG_DFL", "signal.SIG_IGN"])
async def test_a_process_without_heartbeats_is_ended_and_restarted(rig: Rig, term: str) -> None:
    code = BEAT_ONCE.format(term=term)
    rig.start(rig.launch("a", code, heartbeat_s=0.1, hang_grace_s=0.2))
    await wait_until_async(lambda: rig.count("a", EventKind.STARTED) >= 2, timeout_s=_SOON_S)
    (hung, *_) = (event for event in rig.events if event.kind is EventKind.HUNG)
    assert "no heartbeat for" in hung.detail
    (died, *_) = (event for event in rig.events if event.kind is EventKind.EXITED)
    assert "hung" in died.detail


@pytest.mark.skipif(sys.platform == "win32", reason="nice is POSIX's")
async def test_nice_is_given(rig: Rig) -> None:
    code = "import os, time\nwhile os.nice(0) != 7: time.sleep(0.01)\nprint('up', flush=True); time.sleep(60)"
    rig.start(rig.launch("a", code, nice=7))
    await rig.up("a")


async def test_a_restart_that_is_asked_for_takes_the_consumers_along_once(rig: Rig) -> None:
    rig.ready.update("abc")
    rig.start(
        rig.launch("a"),
        rig.launch("b", after=("a",), rest_for_one=True),
        rig.launch("c", after=("b",), rest_for_one=True),
    )
    for name in "abc":
        await rig.up(name)
    rig.supervisor.restart("a")
    for name in "abc":
        await rig.up(name, 2)
    reasons = [(event.name, event.detail) for event in rig.events if event.kind is EventKind.RESTARTING]
    assert sorted(reasons) == [("a", "asked for"), ("b", "a restarted"), ("c", "b restarted")]
    order = [event.name for event in rig.events if event.kind is EventKind.STARTED]
    assert order == ["a", "b", "c", "a", "b", "c"]
