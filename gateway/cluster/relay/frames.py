"""Relays frames to robots that are linked to other gateways, and their results back.

A robot's *owner* is the gateway that has its link. A frame for a remote robot goes to its owner, which puts it on
the robot's control lane: one path for each pair of gateways, so frames keep their order. The owner remembers which
command is whose for as long as a result may come, in memory alone: when it ends, who asked hears that at once.
"""

from __future__ import annotations

import logging
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from gateway.cluster.owner_request import OwnerOf
from gateway.cluster.ports import Mesh
from gateway.cluster.relay.wire import RelayedFrame
from gateway.errors import LeaseRequiredError, RobotOfflineError
from metaros._proto import link_pb2
from metaros.clock import Clock

__all__ = ["Commands", "Leases", "Links", "Offers", "Relay"]

log = logging.getLogger(__name__)

DOWN, UP, LOST = "relay.down", "relay.up", "relay.lost"
TRAVEL_S = 5.0  # beside a command's own time: what is remembered longer will have no result
OnUpstreamFrame = Callable[[str, link_pb2.AgentFrame], None]
REMEMBERED = 65_536  # commands under way between this gateway and all others


class Links(Protocol):
    """The robots that are linked here."""

    def has(self, robot_id: str) -> bool:
        """Whether the robot has a lane here."""

    def send(self, robot_id: str, frame: link_pb2.GatewayFrame) -> None:
        """To its control lane; RobotOfflineError."""


class Commands(Protocol):
    """The commands that were asked for here."""

    def on_result(self, robot: str, result: link_pb2.CommandResult) -> bool:
        """One's result; False when nobody waits for it."""

    def lost(self, robot: str, command_id: bytes, why: str) -> None:
        """One will have no result."""


class Leases(Protocol):
    """Who drives, or who talks."""

    def relayed(self, robot_id: str, teleop: link_pb2.Teleop) -> None:
        """A drive command of another gateway's driver; LeaseRequiredError, RobotOfflineError."""

    def on_offline(self, robot_id: str) -> None:
        """The robot's link is gone."""


class Offers(Protocol):
    """What clients of all gateways serve on the robots that are linked here."""

    def put(self, robot: str, gateway: str, message: link_pb2.Offers) -> None:
        """A gateway's whole list."""

    def answered(self, robot: str, gateway: str, answer: link_pb2.OfferAnswer) -> bool:
        """Whether that gateway was asked."""


@dataclass(frozen=True, slots=True)
class _PendingCommand:
    """A command under way: of which robot, at or from which other gateway, and until when it is remembered."""

    robot: str
    gateway: str
    until_s: float


class _Ledger:
    """Commands by their ids, a bounded number of them; the oldest go first."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._pending: OrderedDict[bytes, _PendingCommand] = OrderedDict()

    def __len__(self) -> int:
        now_s = self._clock.monotonic_s()
        return sum(item.until_s > now_s for item in self._pending.values())

    def add(self, command: link_pb2.Command, robot: str, gateway: str) -> None:
        """One leaves."""
        now_s = self._clock.monotonic_s()
        while self._pending and (
            len(self._pending) >= REMEMBERED or next(iter(self._pending.values())).until_s <= now_s
        ):
            self._pending.popitem(last=False)
        until_s = now_s + command.timeout_ms / 1000 + TRAVEL_S
        self._pending[command.command_id] = _PendingCommand(robot, gateway, until_s)

    def take(self, command_id: bytes, robot: str) -> _PendingCommand | None:
        """One is over; None when it is not known, or another robot's."""
        item = self._pending.get(command_id)
        return self._pending.pop(command_id) if item is not None and item.robot == robot else None

    def take_all(self, *, robot: str = "", gateway: str = "") -> list[tuple[bytes, _PendingCommand]]:
        """All of a robot, or of a gateway, are over."""
        found = [(key, item) for key, item in self._pending.items() if robot == item.robot or gateway == item.gateway]
        for key, _ in found:
            del self._pending[key]
        return found


class Relay:
    """Lives on the event loop."""

    def __init__(
        self,
        mesh: Mesh,
        links: Links,
        commands: Commands,
        drives: Mapping[str, Leases],
        offers: Offers,
        *,
        owner_of: OwnerOf,
        clock: Clock,
    ) -> None:
        """`drives`: the lease managers whose messages need a lease, by the frame that brings them."""
        self._mesh = mesh
        self._links = links
        self._commands = commands
        self._drives = drives
        self._offers = offers
        self._owner_of = owner_of
        self._asked = _Ledger(clock)  # of this gateway, at others
        self._owed = _Ledger(clock)  # of others, at robots that are linked here
        self.on_upstream_frame: OnUpstreamFrame = lambda robot, frame: None  # of a remote robot, but for results
        self.refused: Mapping[str, Callable[[str], None]] = {}  # by frame: somebody there has no lease any more
        mesh.on_message(DOWN, self._on_down)
        mesh.on_message(UP, self._on_up)
        mesh.on_message(LOST, self._on_lost)
        mesh.on_peer(self._on_peer)

    @property
    def owed(self) -> int:
        """How many results other gateways wait for."""
        return len(self._owed)

    def send(self, robot: str, frame: link_pb2.GatewayFrame) -> None:
        """Put a frame on the robot's control lane, wherever its link is; RobotOfflineError when it has none.

        Only what somebody asks for belongs here. What the gateway of the link says of itself (heartbeats, demand,
        durable commands, twins) goes to `Links.send`, which reaches the robots that are linked here and no others.
        """
        owner = "" if self._links.has(robot) else self._owner_of(robot)
        if not owner:
            if frame.HasField("offers"):
                self._offers.put(robot, self._mesh.gateway_id, frame.offers)
            else:
                self._links.send(robot, frame)
            return
        if frame.HasField("command"):
            self._asked.add(frame.command, robot, owner)
        if not self._mesh.send(owner, DOWN, RelayedFrame(robot, frame.SerializeToString()).pack()):
            self._asked.take(frame.command.command_id, robot)
            raise RobotOfflineError(f"robot {robot} cannot be reached now: its gateway does not take more")

    def on_result(self, robot: str, result: link_pb2.CommandResult) -> bool:
        """A robot that is linked here answers; whether another gateway waited for that, and was sent it."""
        owed = None if result.running else self._owed.take(result.command_id, robot)
        if owed is None:
            return False
        self.send_to_requester(owed.gateway, robot, link_pb2.AgentFrame(result=result))
        return True

    def send_to_requester(self, gateway: str, robot: str, frame: link_pb2.AgentFrame) -> None:
        """Something of a robot that is linked here, for one other gateway."""
        self._mesh.send(gateway, UP, RelayedFrame(robot, frame.SerializeToString()).pack())

    def on_offline(self, robot: str) -> None:
        """A link here is gone: who waits at other gateways hears of it."""
        for command_id, owed in self._owed.take_all(robot=robot):
            self._mesh.send(owed.gateway, LOST, RelayedFrame(robot, command_id, 1).pack())

    # -- messages of others ------------------------------------------------------------------------------------------

    def _on_down(self, sender: str, payload: bytes) -> None:
        relayed = RelayedFrame.unpack(payload)
        frame = link_pb2.GatewayFrame.FromString(relayed.frame)
        command_id = frame.command.command_id
        try:
            self._put(sender, relayed.robot, frame)
        except RobotOfflineError:
            self._owed.take(command_id, relayed.robot)
            self._mesh.send(sender, LOST, RelayedFrame(relayed.robot, command_id).pack())

    def _put(self, sender: str, robot: str, frame: link_pb2.GatewayFrame) -> None:
        match frame.WhichOneof("frame"):
            case "command":
                self._owed.add(frame.command, robot, sender)
                self._links.send(robot, frame)
            case "teleop" | "talk" as kind:
                try:
                    self._drives[kind].relayed(robot, frame.teleop if kind == "teleop" else frame.talk)
                except LeaseRequiredError:
                    self.refused[kind](sender)
            case "offers":
                self._offers.put(robot, sender, frame.offers)
            case "offer_answer":
                if self._offers.answered(robot, sender, frame.offer_answer):
                    self._links.send(robot, frame)
            case kind:
                log.warning("the gateway %s sends robot %s a %s frame, which is not relayed", sender, robot, kind)

    def _on_up(self, sender: str, payload: bytes) -> None:
        relayed = RelayedFrame.unpack(payload)
        frame = link_pb2.AgentFrame.FromString(relayed.frame)
        if frame.HasField("result"):
            self._asked.take(frame.result.command_id, relayed.robot)
            self._commands.on_result(relayed.robot, frame.result)
        else:
            self.on_upstream_frame(relayed.robot, frame)

    def _on_lost(self, sender: str, payload: bytes) -> None:
        relayed = RelayedFrame.unpack(payload)
        if self._asked.take(relayed.frame, relayed.robot) is not None:
            left = "lost its link; the outcome is not known" if relayed.number else "has no link now"
            self._commands.lost(relayed.robot, relayed.frame, f"robot {relayed.robot} {left}")
        elif not relayed.frame and not self._links.has(relayed.robot):
            for manager in self._drives.values():
                manager.on_offline(relayed.robot)

    def _on_peer(self, gateway: str, there: bool) -> None:
        if there:
            return
        self._owed.take_all(gateway=gateway)
        for command_id, asked in self._asked.take_all(gateway=gateway):
            why = f"robot {asked.robot} lost its link, as its gateway went; the outcome is not known"
            self._commands.lost(asked.robot, command_id, why)
