"""What other features tell becomes events: which of it, with what data, and nothing twice."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import orjson
import pytest

from gateway.automation.events.kinds import EVENT_KINDS, event_kind
from gateway.automation.events.recorder import EventRecorder
from gateway.domain.fleet.command import Command
from gateway.domain.fleet.recording import Recording
from gateway.domain.fleet.twin import Reported
from gateway.domain.robot import Robot
from gateway.store.engine import StoreEngine
from metaros.clock import ManualClock


class NoStore:
    """A store that is asked for nothing: what was emitted waits."""

    shared = False
    gateway_id = "g"

    async def run(self, job: Callable[[StoreEngine], Any]) -> Any:
        """Nothing is stored."""
        raise AssertionError("not to be asked")

    read = run


class Told(EventRecorder):
    """Events, and what was emitted so far."""

    def __init__(self) -> None:
        super().__init__(NoStore(), clock=ManualClock())
        self.emitted: list[tuple[str, str, dict[str, Any]]] = []
        emit = self.journal.emit

        def kept(kind: str, robot: str = "", data: Any = None) -> None:
            emit(kind, robot, data)
            assert set(data or {}) <= set(event_kind(kind).data), kind
            self.emitted.append((kind, robot, dict(data or {})))

        self.journal.emit = kept  # type: ignore[method-assign]


@pytest.fixture
def told() -> Told:
    """A feature that remembers."""
    return Told()


def report(state: str, *, revision: int = 7, nodes: dict[str, Any] | None = None, **more: Any) -> Reported:
    """A robot's report."""
    values = orjson.dumps({"nodes": nodes or {}})
    return Reported(robot="r1", at_ns=1, revision=revision, applied=revision, state=state, reported=values, **more)


def command(state: str, kind: str = "call_service") -> Command:
    """A command at its end."""
    return Command(
        id="C1",
        robot="r1",
        kind=kind,
        request="{}",
        wire=b"",
        issuer="user:1",
        issued_by="ada",
        digest="",
        durable=False,
        timeout_ms=1,
        issued_ns=1,
        state=state,
        code="timeout" if state == "failed" else "",
    )


def test_robots_and_leases(told: Told) -> None:
    told.on_online(Robot("r1", hostname="h", agent_version="2"), True)
    told.on_online(Robot("r1", hostname="h", agent_version="2"), False)
    told.on_lease("r1", "ada", True)
    told.on_lease("r1", "ada", False)
    assert told.emitted == [
        ("robot.online", "r1", {"hostname": "h", "agent_version": "2"}),
        ("robot.offline", "r1", {}),
        ("lease.taken", "r1", {"holder": "ada"}),
        ("lease.ended", "r1", {"holder": "ada"}),
    ]


def test_a_command_that_ended_and_no_good_publish(told: Told) -> None:
    told.on_command(command("done"))
    told.on_command(command("done", "publish"))
    told.on_command(command("failed", "publish"))
    assert [(data["kind"], data["state"], data["code"]) for _, _, data in told.emitted] == [
        ("call_service", "done", ""),
        ("publish", "failed", "timeout"),
    ]
    assert told.emitted[0][2]["issued_by"] == "ada"


def test_a_twin_settles_once(told: Told) -> None:
    before: Reported | None = None
    for state, revision in [
        ("applying", 7),
        ("confirming", 7),
        ("applied", 7),
        ("applied", 7),
        ("refused", 8),
        ("refused", 8),
        ("applied", 9),
        ("reverted", 10),
    ]:
        after = report(state, revision=revision, code="x", message="why" * 400)
        told.on_twin(before, after)
        before = after
    assert [(kind, data["revision"]) for kind, _, data in told.emitted] == [
        ("twin.applied", 7),
        ("twin.refused", 8),
        ("twin.applied", 9),
        ("twin.reverted", 10),
    ]
    assert told.emitted[1][2]["code"] == "x"
    assert len(told.emitted[1][2]["message"]) == 500
    told.emitted.clear()
    told.on_twin(None, report("applied", revision=0))  # it lives by no twin at all
    assert told.emitted == []


def test_a_node_that_crashes_is_reported_each_time(told: Told) -> None:
    rows: list[dict[str, Any]] = [
        {"state": "running", "restarts": 0, "crashes": 0},
        {"state": "waiting", "restarts": 0, "crashes": 1},
        {"state": "running", "restarts": 1, "crashes": 1},
        {"state": "quarantined", "restarts": 5, "crashes": 6, "quarantined": True},
        {"state": "quarantined", "restarts": 5, "crashes": 6, "quarantined": True, "why": "x"},
        {"state": "running", "restarts": 6, "crashes": 6, "quarantined": False},
    ]
    before: Reported | None = None
    for row in rows:
        after = report("applying", nodes={"camera": row, "other": {"state": "running"}})
        told.on_twin(before, after)
        before = after
    assert [(kind, data) for kind, _, data in told.emitted if kind != "node.state"] == [
        ("node.crashed", {"node": "camera", "restarts": 0, "crashes": 1}),
        ("node.crashed", {"node": "camera", "restarts": 5, "crashes": 6}),
        ("node.quarantined", {"node": "camera", "restarts": 5}),
    ]


def test_a_node_in_another_state_is_reported_once(told: Told) -> None:
    rows: list[dict[str, Any]] = [
        {},
        {"camera": {"state": "starting"}},
        {"camera": {"state": "running", "pid": 7}},
        {"camera": {"state": "running", "pid": 8}},
        {"camera": {"state": "waiting", "last_exit": "signal 9", "restarts": 3}},
        {},
    ]
    before: Reported | None = None
    for row in rows:
        after = report("applied", nodes=row)
        told.on_twin(before, after)
        before = after
    states = [data for kind, _, data in told.emitted if kind == "node.state"]
    assert [(data["node"], data["before"], data["state"]) for data in states] == [
        ("camera", "absent", "starting"),
        ("camera", "starting", "running"),
        ("camera", "running", "waiting"),
        ("camera", "waiting", "absent"),
    ]
    assert (states[2]["why"], states[2]["restarts"]) == ("signal 9", 3)


def test_nodes_that_a_robot_left_out_of_a_report_are_not_gone(told: Told) -> None:
    whole = report("applied", nodes={"camera": {"state": "running"}})
    short = Reported(robot="r1", at_ns=1, revision=7, applied=7, state="applied", reported=b'{"left_out":["nodes"]}')
    told.emitted.clear()
    told.on_twin(whole, short)
    told.on_twin(short, whole)
    assert told.emitted == []


@pytest.mark.parametrize(
    "odd", [b"", b"[]", b"{", b'{"nodes":3}', b'{"nodes":{"a":3}}', b'{"nodes":{"a":{"crashes":"x"}}}']
)
def test_what_a_robot_says_oddly_is_no_event(told: Told, odd: bytes) -> None:
    good = report("applying", nodes={"a": {"crashes": 0}})
    bad = Reported(robot="r1", at_ns=1, revision=7, applied=7, state="applying", reported=odd)
    told.on_twin(good, bad)
    told.on_twin(bad, good)
    assert told.emitted == []


def test_recordings(told: Told) -> None:
    facts: dict[str, Any] = {"id": "R", "robot": "r1", "from_ns": 0, "to_ns": 1, "topics": (), "requested_ns": 1}
    told.on_recording(Recording(state="stored", size_bytes=9, live_ns=1, **facts))
    told.on_recording(Recording(state="failed", code="expired", message="m", live_ns=1, **facts))
    assert told.emitted == [
        ("recording.stored", "r1", {"recording": "R", "size_bytes": 9}),
        ("recording.failed", "r1", {"recording": "R", "code": "expired", "message": "m"}),
    ]


def test_every_kind_is_named_once_and_knows_its_data() -> None:
    assert len({row.name for row in EVENT_KINDS}) == len(EVENT_KINDS)
    assert all(row.meaning and "." in row.name for row in EVENT_KINDS)
