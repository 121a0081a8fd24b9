"""Sessions one after the other: their numbers, where their events go, and what ends with them."""

from __future__ import annotations

import logging
import random  # noqa: TID251 - seeded
from dataclasses import dataclass, field
from typing import Any, cast

import pytest

from edge_agent.commands.dispatcher import CommandDispatcher
from edge_agent.commands.teleop import Teleop
from edge_agent.config.topic_table import TopicTable
from edge_agent.errors import LinkError, RefusedError
from edge_agent.forwarding.channels import Channels
from edge_agent.forwarding.live_batch import Linger
from edge_agent.forwarding.live_queue import LiveQueue
from edge_agent.link.budget import Budget
from edge_agent.link.frames import CommandArrived, TeleopArrived
from edge_agent.state.store_id import StoreId
from edge_agent.uplink.queues import Queues
from edge_agent.uplink.session import Established, Identity
from edge_agent.uplink.session_manager import SessionManager
from metaros._proto import link_pb2
from metaros.clock import ManualClock
from tests.edge_agent.parts import accept, make_outbox
from tests.support.simulation.sim_disk import SimDisk

WHO = Identity(robot_id="r", session_id=bytes(16), agent_version="0", namespace="/", hostname="h")


@dataclass
class Ends:
    """Where teleop and commands go."""

    drives: list[TeleopArrived] = field(default_factory=list)
    commands: list[CommandArrived] = field(default_factory=list)
    lost: int = 0

    def drive(self, event: TeleopArrived) -> None:
        self.drives.append(event)

    def link_lost(self) -> None:
        self.lost += 1

    def handle(self, event: CommandArrived, answer: Any) -> None:
        self.commands.append(event)
        answer(link_pb2.CommandResult(command_id=event.command.command_id, ok=True))


class Rig:
    def __init__(self) -> None:
        self.clock, self.disk, self.ends = ManualClock(), SimDisk(random.Random(1)), Ends()
        self.outbox = make_outbox(self.disk, self.clock)
        self.queues = Queues(
            Channels(TopicTable(), self.outbox.ids, namespace="/"),
            self.outbox,
            LiveQueue(),
            Linger(),
            Budget(now_s=self.clock.monotonic_s()),
        )
        self.woken = 0
        self.store_id = StoreId(self.disk)
        self.session_manager = SessionManager(
            WHO,
            self.queues,
            cast(Teleop, self.ends),
            cast(CommandDispatcher, self.ends),
            self.clock,
            store_id=self.store_id,
            malformed=int,
            wake=self.wake,
        )

    def wake(self) -> None:
        self.woken += 1


def test_numbers_grow_and_a_restarted_agent_begins_above_its_older_self() -> None:
    rig = Rig()
    first, second = rig.session_manager.new_session(), rig.session_manager.new_session()
    assert second.number == first.number + 1
    rig.clock.advance(1.0)
    rig.session_manager = SessionManager(
        WHO,
        rig.queues,
        cast(Teleop, rig.ends),
        cast(CommandDispatcher, rig.ends),
        rig.clock,
        store_id=rig.store_id,
        malformed=int,
        wake=rig.wake,
    )
    assert rig.session_manager.new_session().number > second.number


def test_an_established_session_makes_what_comes_fresh_and_its_store_ours() -> None:
    rig = Rig()
    session = rig.session_manager.new_session()
    assert not rig.outbox.online
    rig.session_manager.handle(session, Established("gw", "hall-3"))
    assert rig.outbox.online
    assert StoreId(rig.disk).value == "hall-3"
    assert rig.session_manager.new_session().store_id == "hall-3"
    rig.session_manager.session_ended(LinkError("gone"))
    assert not rig.outbox.online


def test_the_end_stops_what_moves_and_forgets_what_only_viewers_wanted() -> None:
    rig = Rig()
    channel = rig.queues.channels.observe("/a", "std_msgs/msg/String", "RIHS01_00", qos="", keeps_all=False)
    assert channel is not None
    rig.queues.channels.demand({channel.channel_id: 5.0})
    rig.queues.live.append(channel, 1, b"x")
    rig.session_manager.session_ended()
    assert (rig.ends.lost, len(rig.queues.live), channel.selector.demand_hz) == (1, 0, None)


def test_commands_and_teleop_go_on_and_answers_come_back() -> None:
    rig = Rig()
    session = rig.session_manager.new_session()
    teleop = TeleopArrived(link_pb2.Teleop(seq=4), 0.1)
    rig.session_manager.handle(session, teleop)
    assert rig.ends.drives == [teleop]
    rig.session_manager.handle(session, CommandArrived(link_pb2.Command(command_id=b"c" * 16), 1.0))
    assert len(rig.ends.commands) == 1
    assert rig.woken == 1


def test_a_fork_puts_what_is_held_under_new_epochs(caplog: pytest.LogCaptureFixture) -> None:
    rig = Rig()
    rig.outbox.append(1, "event", 5, b"x")
    accept(rig.outbox)
    (before,) = rig.outbox.ranges()
    with caplog.at_level(logging.WARNING):
        rig.session_manager.session_ended(RefusedError("forked", "another copy"))
    (after,) = rig.outbox.ranges()
    assert after.epoch != before.epoch
    assert (after.first_seq, after.last_seq, after.base_seq) == (1, 1, 0)
    assert "another copy of this outbox" in caplog.text
    rig.session_manager.session_ended(RefusedError("fenced", "a newer session"))
    assert rig.outbox.ranges() == [after]


def test_a_fork_on_a_full_disk_is_said_and_tried_again() -> None:
    rig = Rig()
    rig.outbox.append(1, "event", 5, b"x")
    accept(rig.outbox)
    (before,) = rig.outbox.ranges()
    rig.disk.size_bytes = 0
    rig.session_manager.session_ended(RefusedError("forked", "another copy"))
    assert rig.outbox.ranges() == [before]
    rig.disk.size_bytes = 1 << 30
    rig.session_manager.session_ended(RefusedError("forked", "another copy"))
    assert rig.outbox.ranges() != [before]
