"""One event after the other to its end: tried again, dead, too old, lost; what its answer asks for."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from metaros.automation.functions.calls import FunctionSpec, Invocation, Outcome
from metaros.automation.functions.errors import ThrottledError
from metaros.automation.robot.actions import Action, read_actions
from metaros.automation.robot.backlog import Backlog, NewEvent
from metaros.automation.robot.manifest import parse_function
from metaros.automation.robot.policy import FunctionPolicy
from metaros.automation.robot.runner import LOSSES, Runner
from metaros.clock import ManualClock
from metaros.errors import UnavailableError

FUNCTION = parse_function(
    json.dumps(
        {
            "name": "f",
            "handler": "a.b",
            "triggers": [{"topic": "t"}],
            "retry": {"attempts": 3, "max_age_s": 600},
        }
    )
)
SPEC = FunctionSpec(key="f", name="f", version="1", arn="arn", handler="a.b", code_dir=Path())
FAILED = Outcome(payload=b'{"errorMessage": "broken", "errorType": "ValueError"}', error_type="ValueError")


class Even:
    """Chance that is none."""

    def uniform(self, a: float, b: float) -> float:
        return (a + b) / 2


class World:
    """A backlog with one event, an engine that answers as it is told, and a robot that does."""

    def __init__(self, folder: Path, clock: ManualClock) -> None:
        self.backlog, self.clock = Backlog(folder / "b"), clock
        self.answer: Callable[[], Outcome] = lambda: Outcome(payload=b"null")
        self.asked: list[str] = []
        self.done: list[str] = []
        self.runner = Runner(
            FUNCTION,
            SPEC,
            self.backlog,
            self.invoke,
            read=lambda returned: read_actions(returned, FunctionPolicy("/r"), lambda name: f"/r/{name}"),
            do=self.do,
            robot="r",
            clock=clock,
            rng=Even(),
        )
        self.backlog.keep([NewEvent(trigger="t", name="e", payload=b"{}", at_ns=clock.wall_ns())], [])

    async def invoke(self, spec: FunctionSpec, call: Invocation) -> Outcome:
        self.asked.append(call.request_id)
        return self.answer()

    def do(self, action: Action) -> dict[str, Any]:
        if action.name == "/r/gone":
            raise UnavailableError("nobody serves it")
        self.done.append(action.name)
        return {"kind": action.kind, "name": action.name}

    async def attempt(self) -> dict[str, Any]:
        """The event, as soon as it is due; what came of it."""
        due_ns = self.backlog.next_due_ns()
        assert due_ns is not None
        self.clock.advance(max(0, due_ns - self.clock.wall_ns()) / 1e9 + 1e-3)
        (event,) = self.backlog.lease(1, now_ns=self.clock.wall_ns())
        await self.runner.handle(event)
        results = self.backlog.unsent(100)
        return dict(json.loads(results[-1].document)) if results else {}


@pytest.fixture
def world(tmp_path: Path, clock: ManualClock) -> Iterator[World]:
    world = World(tmp_path, clock)
    yield world
    world.backlog.close()


async def test_what_fails_is_tried_again_under_its_id_and_then_dead(world: World) -> None:
    world.answer = lambda: FAILED
    found = [await world.attempt() for _ in range(3)]
    assert [(one["status"], one["attempt"]) for one in found] == [("error", 1), ("error", 2), ("dead", 3)]
    assert found[0]["error_message"] == "broken"
    assert len(set(world.asked)) == 1
    assert (world.backlog.next_due_ns(), world.backlog.counts().dead) == (None, 1)


async def test_what_could_not_be_called_costs_no_attempt(world: World) -> None:
    def full() -> Outcome:
        raise ThrottledError("full", reason="ConcurrentInvocationLimitExceeded")

    world.answer = full
    for _ in range(5):
        assert await world.attempt() == {}
    world.answer = lambda: Outcome(payload=b'{"n": 1}')
    done = await world.attempt()
    assert (done["status"], done["attempt"], done["payload"]) == ("ok", 1, {"n": 1})


async def test_a_service_that_is_not_there_fails_the_attempt(world: World) -> None:
    asked = {"call": [{"service": name, "type": "std_srvs/srv/Trigger"} for name in ("here", "gone")]}
    world.answer = lambda: Outcome(payload=json.dumps(asked).encode())
    found = await world.attempt()
    assert (found["status"], found["error_type"]) == ("error", "unavailable")
    assert [action.get("error") for action in found["actions"]] == [None, "nobody serves it"]
    assert (await world.attempt())["attempt"] == 2
    assert world.done == ["/r/here"] * 2  # at least once


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"publish": {}}, "publish: a list"),
        ({"publish": [{"topic": "a"}]}, "topic, type and message"),
        ({"publish": [{"topic": "a", "type": "no/msg/Such"}]}, "no/msg/Such"),
        ({"publish": [{"topic": "a", "type": "std_msgs/msg/String", "message": {"date": ""}}]}, "date"),
        ({"publish": [{"topic": "cmd_vel", "type": "geometry_msgs/msg/Twist"}]}, "moves the robot"),
        ({"call": [{"service": "a", "type": "std_msgs/msg/String"}]}, "no type of a service"),
        ({"publish": [{"topic": "a", "type": "std_msgs/msg/String"}] * 33}, "at most 32"),
    ],
)
async def test_what_may_not_be_asked_for_is_dead_at_once(world: World, asked: dict[str, Any], said: str) -> None:
    world.answer = lambda: Outcome(payload=json.dumps(asked).encode())
    found = await world.attempt()
    assert (found["status"], found["error_type"]) == ("dead", "action_refused")
    assert said in found["error_message"]
    assert world.done == []


async def test_what_is_too_old_or_ended_too_many_lives_is_not_called(world: World) -> None:
    world.clock.advance(601)
    assert (await world.attempt())["error_type"] == "too_old"
    world.backlog.redrive(now_ns=world.clock.wall_ns())
    for _ in range(LOSSES):
        world.backlog.lease(1, now_ns=world.clock.wall_ns())
        assert world.backlog.recover() == 1
    assert (await world.attempt())["error_type"] == "lost"
    assert world.asked == []
