"""Goals as a gateway keeps them: what a robot tells counts, readers never wait for each other, and all of it ends."""

from __future__ import annotations

import asyncio
from contextlib import aclosing
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from gateway.domain.fleet.lease import LeaseTable
from gateway.errors import LeaseRequiredError, ProtocolError, RobotOfflineError, TooManyError
from gateway.fleet.command_dispatcher import CommandDispatcher
from gateway.fleet.manager import FleetManager
from gateway.fleet.ros.errors import UnknownGoalError
from gateway.fleet.ros.goal import Goal, GoalEvent
from gateway.fleet.ros.goals import GoalManager
from gateway.fleet.ros.graph_registry import GraphRegistry
from gateway.ingest.frame_checks import read_ros
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.clock import ManualClock
from metaros.idl import message_class
from metaros.limits import LIMITS, Limits
from tests.support.waiting import wait_until_async

FIBONACCI = "example_interfaces/action/Fibonacci"


class Manager(GoalManager):
    """Goals of robot r; `sent` is what went to it."""

    def __init__(self, clock: ManualClock, limits: Limits = LIMITS) -> None:
        self.sent: list[link_pb2.Command] = []
        self.commands = CommandDispatcher(lambda robot, frame: self.sent.append(frame.command), clock=clock)
        fleet = FleetManager(self.robot, self.commands, LeaseTable(valid_s=3.0), clock=clock)
        super().__init__(self.robot, self.commands, fleet, GraphRegistry(), clock=clock, limits=limits)

    @staticmethod
    def robot(robot_id: str) -> Any:
        """As the registry does."""
        robot = SimpleNamespace(id=robot_id, namespace="/r")
        return SimpleNamespace(robot=robot, online=True, rtt_s=None, channel_of=lambda topic: None)

    def told(self, number: int, **facts: Any) -> Goal:
        """The robot tells of a goal."""
        told = {"action": "/r/count", "type_name": FIBONACCI, "status": 2, **facts}
        event = link_pb2.GoalEvent(goal_id=number.to_bytes(16, "big"), **told)
        self.on_events("r", link_pb2.GoalEvents(events=[event]))
        return self.find("r", event.goal_id.hex())


def feedback(number: int) -> bytes:
    message = message_class(f"{FIBONACCI}_FeedbackMessage")()
    message.feedback.sequence = [number]
    return codec(message).encode(message)


async def test_a_goal_without_a_link_for_too_long_is_lost_and_then_forgotten(clock: ManualClock) -> None:
    manager = Manager(clock)
    goal = manager.told(1)
    manager.on_online("r", online=False)
    clock.advance(LIMITS.goal_lost_s - 1)
    manager.tick()
    assert (goal.reachable, goal.ended) == (False, False)
    clock.advance(2)
    manager.tick()
    assert (goal.status, goal.ended) == ("lost", True)
    assert "no link" in goal.message
    assert manager.told(1, ended=True, status=4).status == "lost"  # an end is an end
    clock.advance(LIMITS.goal_kept_s + 1)
    manager.tick()
    with pytest.raises(UnknownGoalError):
        manager.find("r", goal.id)


async def test_a_link_that_comes_back_in_time_brings_the_goal_back(clock: ManualClock) -> None:
    manager = Manager(clock)
    kept, gone = manager.told(1), manager.told(2)
    manager.on_online("r", online=False)
    manager.told(1)
    manager.on_events("r", link_pb2.GoalEvents(all_told=True, goal_ids=[kept.goal_id]))
    assert (kept.reachable, kept.ended, gone.status) == (True, False, "lost")
    clock.advance(LIMITS.goal_lost_s + 1)
    manager.tick()
    assert not kept.ended


async def test_a_slow_reader_gets_the_newest_feedback_and_every_status(clock: ManualClock) -> None:
    manager = Manager(clock)
    goal = manager.told(1, status=1)
    seen: list[GoalEvent] = []
    async with aclosing(goal.events()) as events:
        seen.append(await anext(events))
        for number in range(100):
            manager.told(1, feedback=feedback(number))
        manager.told(1, status=3)
        manager.told(1, status=5, ended=True)
        seen.extend([event async for event in events])
    assert [(event.kind, event.status) for event in seen] == [
        ("status", "accepted"),
        ("status", "executing"),
        ("feedback", "executing"),
        ("status", "canceling"),
        ("result", "canceled"),
    ]
    assert seen[2].value == {"sequence": [99]}
    assert len(seen[2].cdr) > 4


async def test_readers_and_goals_are_bounded(clock: ManualClock) -> None:
    manager = Manager(clock, replace(LIMITS, goals_open=2, goals_kept=3))
    goal = manager.told(1)
    readers = [goal.events() for _ in range(LIMITS.goal_readers)]
    for reader in readers:
        await anext(reader)
    with pytest.raises(TooManyError):
        await anext(goal.events())
    await asyncio.gather(*(reader.aclose() for reader in readers))
    await anext(goal.events())  # their places are free again
    manager.told(2)
    with pytest.raises(UnknownGoalError):
        manager.told(3)  # a robot that tells more than it may is not believed
    with pytest.raises(TooManyError):
        await manager.send("r", "count", type_name=FIBONACCI, goal={"order": 1})
    manager.told(1, ended=True, status=4)
    manager.told(2, ended=True, status=4)
    manager.told(3)
    manager.told(4)
    assert [one.goal_id[-1] for one in manager.of("r")] == [4, 3, 2]


async def test_what_a_robot_tells_of_a_goal_is_bounded(clock: ManualClock) -> None:
    """Two hundred goals are kept, each with its last feedback and its result: not with megabytes of them."""
    manager = Manager(clock)
    goal = manager.told(1, feedback=bytes(LIMITS.goal_feedback_bytes + 1), message="m" * 10_000)
    assert (goal.newest_feedback, goal.skipped, goal.status) == (None, 1, "executing")
    manager.told(1, ended=True, status=4, result=bytes(LIMITS.result_bytes + 1))
    assert (goal.status, goal.result_cdr) == ("succeeded", b"")
    assert "left out" in goal.message
    assert len(manager.told(2, ended=True, status=6, message="m" * 10_000).message) <= 1024
    with pytest.raises(UnknownGoalError):
        manager.told(3, action="/r/" + "a" * 10_000)
    huge = manager.told(4, feedback=bytes(LIMITS.goal_feedback_bytes + 1), skipped=(1 << 64) - 1)
    assert huge.skipped == 1 << 62


def test_a_frame_tells_of_no_more_goals_than_there_can_be() -> None:
    """Each costs the gateway's loop some microseconds; a frame has room for two hundred thousand."""
    for frame in (
        link_pb2.AgentFrame(goals=link_pb2.GoalEvents(events=[link_pb2.GoalEvent(goal_id=bytes(16))] * 10_000)),
        link_pb2.AgentFrame(goals=link_pb2.GoalEvents(all_told=True, goal_ids=[bytes(16)] * 10_000)),
        link_pb2.AgentFrame(offer_states=link_pb2.OfferStates(states=[link_pb2.OfferState(number=1)] * 10_000)),
    ):
        with pytest.raises(ProtocolError, match="more goals or offers"):
            read_ros(link_pb2.LANE_CONTROL, frame)


async def test_a_link_that_goes_while_a_goal_is_sent_ends_the_call_at_once(clock: ManualClock) -> None:
    manager = Manager(clock)
    sending = asyncio.create_task(manager.send("r", "count", type_name=FIBONACCI, goal={"order": 1}))
    await wait_until_async(lambda: manager.sent)
    sent = manager.sent[0].send_goal
    assert (sent.action, sent.type_name, len(sent.goal_id)) == ("/r/count", FIBONACCI, 16)
    manager.commands.on_offline("r")
    with pytest.raises(RobotOfflineError):
        await sending
    assert manager.of("r") == []


async def test_an_action_that_moves_the_robot_needs_the_lease(clock: ManualClock) -> None:
    manager = Manager(clock)
    with pytest.raises(LeaseRequiredError):
        await manager.send("r", "cmd_vel", type_name=FIBONACCI, goal={"order": 1})
    assert manager.sent == []
