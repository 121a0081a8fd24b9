"""Robots' ROS graphs and goals at every gateway, and what clients of any gateway serve in them.

A robot's owner broadcasts what its agent reports, as it comes. Graphs come as changes, each with the number after
the one before: a gateway that misses one, or comes later, asks the owner for the whole.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
from collections import Counter
from typing import Protocol

from gateway.cluster.errors import PeerGoneError
from gateway.cluster.ports import Mesh
from gateway.cluster.relay.offers import OfferMerge
from gateway.cluster.relay.wire import RelayedFrame, join, split
from gateway.errors import GatewayError, RobotOfflineError
from metaros._proto import link_pb2

__all__ = ["Graphs", "OpenGoals", "Robots", "RosFeature", "RosRelay", "SendTo"]

log = logging.getLogger(__name__)

TOLD, KNOWN, WHOLE = "ros.told", "ros.known", "ros.whole"
KNOWN_AT_ONCE = 1000
WHOLE_S = 10.0


class Graphs(Protocol):
    """The graphs that robots reported."""

    def known(self) -> list[str]:
        """The robots that reported something."""

    def knows(self, robot_id: str) -> bool:
        """Whether one is kept, whole or not."""

    def reports(self, robot_id: str) -> list[link_pb2.GraphReport]:
        """All of one, as its agent would report it anew."""


class OpenGoals(Protocol):
    """The goals of robots."""

    def open_events(self, robot_id: str) -> link_pb2.GoalEvents:
        """How the open ones stand."""


class RosFeature(Protocol):
    """The gateway's own part for ROS graphs."""

    @property
    def graphs(self) -> Graphs:
        """What robots reported."""

    @property
    def goals(self) -> OpenGoals:
        """What robots do."""

    def on_frame(self, robot_id: str, frame: link_pb2.AgentFrame) -> None:
        """A frame of a robot."""


class Robots(Protocol):
    """The robots that are linked here."""

    def has(self, robot_id: str) -> bool:
        """Whether one is."""

    def send(self, robot_id: str, frame: link_pb2.GatewayFrame) -> None:
        """To its control lane; RobotOfflineError."""


class SendTo(Protocol):
    """Sends a frame of a local robot to one other gateway."""

    def __call__(self, gateway: str, robot: str, frame: link_pb2.AgentFrame) -> None:
        """Soon, in order."""


class RosRelay:
    """Lives on the event loop; `run` asks for what is missing."""

    def __init__(self, mesh: Mesh, robots: Robots, feature: RosFeature) -> None:
        self._mesh = mesh
        self._robots = robots
        self._feature = feature
        self.send_to: SendTo = lambda gateway, robot, frame: None
        self._merge = OfferMerge()
        self._numbers: Counter[str] = Counter()  # of the reports of robots that are linked here
        self._received: dict[str, tuple[str, int]] = {}  # of others: from which gateway, and the last number
        self._newest: dict[str, int] = {}  # the highest number that was seen, of those that are asked for
        self._wanted: dict[tuple[str, str], None] = {}  # owner and robot
        self._wake = asyncio.Event()
        mesh.on_message(TOLD, self._on_update)
        mesh.on_message(KNOWN, self._on_known)
        mesh.on_request(WHOLE, self._on_whole)
        mesh.on_peer(self._on_peer)

    # -- robots that are linked here --------------------------------------------------------------------------------

    def on_frame(self, robot: str, frame: link_pb2.AgentFrame) -> None:
        """A robot's agent says something of its graph, of goals or of offers."""
        kind = frame.WhichOneof("frame")
        if kind in ("graph", "goals"):
            self._feature.on_frame(robot, frame)
            self._numbers[robot] += kind == "graph"
            self._mesh.broadcast(TOLD, RelayedFrame(robot, frame.SerializeToString(), self._numbers[robot]).pack())
        elif kind == "offer_states":
            for gateway, states in self._merge.states(robot, frame.offer_states).items():
                self._send(gateway, robot, link_pb2.AgentFrame(offer_states=states))
        elif kind == "asked":
            gateway = self._merge.asked(robot, frame.asked)
            self._send(gateway or self._mesh.gateway_id, robot, frame)

    def on_online(self, robot: str, online: bool) -> None:
        """A link here began or ended."""
        if online:
            self._received.pop(robot, None)
        else:
            self._merge.forget(robot)

    def put(self, robot: str, gateway: str, message: link_pb2.Offers) -> None:
        """What a gateway's clients serve on a robot that is linked here; RobotOfflineError."""
        refused = self._merge.put(robot, gateway, message)
        try:
            self._robots.send(robot, link_pb2.GatewayFrame(offers=self._merge.list_of(robot)))
        except RobotOfflineError:
            self._merge.forget(robot)
            raise
        if refused is not None:
            self._send(gateway, robot, link_pb2.AgentFrame(offer_states=refused))

    def answered(self, robot: str, gateway: str, answer: link_pb2.OfferAnswer) -> bool:
        """Whether that gateway's client was asked."""
        return self._merge.answered(robot, gateway, answer)

    def _send(self, gateway: str, robot: str, frame: link_pb2.AgentFrame) -> None:
        if gateway == self._mesh.gateway_id:
            self._feature.on_frame(robot, frame)
        else:
            self.send_to(gateway, robot, frame)

    async def _on_whole(self, sender: str, payload: bytes) -> bytes:
        """A robot's whole graph and its open goals; an empty answer where it is not linked here."""
        robot = payload.decode()
        if not self._robots.has(robot):
            return b""
        frames = [link_pb2.AgentFrame(graph=report) for report in self._feature.graphs.reports(robot)]
        frames.append(link_pb2.AgentFrame(goals=self._feature.goals.open_events(robot)))
        return RelayedFrame(robot, join(frame.SerializeToString() for frame in frames), self._numbers[robot]).pack()

    # -- robots that are linked elsewhere ----------------------------------------------------------------------------

    def _on_update(self, sender: str, payload: bytes) -> None:
        relayed = RelayedFrame.unpack(payload)
        robot = relayed.robot
        if self._robots.has(robot):
            return  # what an earlier owner says is over
        frame = link_pb2.AgentFrame.FromString(relayed.frame)
        if frame.HasField("goals"):
            self._feature.on_frame(robot, frame)
            return
        follows = self._received.get(robot) == (sender, relayed.number - 1) and self._feature.graphs.knows(robot)
        if frame.graph.anew or follows:
            self._received[robot] = (sender, relayed.number)
            self._feature.on_frame(robot, frame)
        else:
            self._want(sender, robot, relayed.number)

    def _on_known(self, sender: str, payload: bytes) -> None:
        for robot, number in json.loads(payload):
            if self._received.get(robot) != (sender, number) and not self._robots.has(robot):
                self._want(sender, robot, number)

    def _on_peer(self, gateway: str, there: bool) -> None:
        if there:
            mine = [(robot, self._numbers[robot]) for robot in self._feature.graphs.known() if self._robots.has(robot)]
            for start in range(0, len(mine), KNOWN_AT_ONCE):
                self._mesh.send(gateway, KNOWN, json.dumps(mine[start : start + KNOWN_AT_ONCE]).encode())
            return
        self._received = {robot: received for robot, received in self._received.items() if received[0] != gateway}
        self._wanted = {key: None for key in self._wanted if key[0] != gateway}
        for robot, asks in self._merge.drop(gateway).items():
            self._dropped(robot, asks)

    def _dropped(self, robot: str, asks: list[int]) -> None:
        """Whose clients went with their gateway: nobody is served by them, and nobody waits for them."""
        with contextlib.suppress(RobotOfflineError):
            for ask in asks:
                gone = link_pb2.OfferAnswer(ask=ask, ended=True, message="its client's gateway went away", status=6)
                self._robots.send(robot, link_pb2.GatewayFrame(offer_answer=gone))
            self._robots.send(robot, link_pb2.GatewayFrame(offers=self._merge.list_of(robot)))

    def _want(self, owner: str, robot: str, number: int) -> None:
        self._newest[robot] = max(number, self._newest.get(robot, 0))
        self._wanted[owner, robot] = None
        self._wake.set()

    async def run(self) -> None:
        """Ask for whole graphs, one after another, until cancelled."""
        while True:
            await self._wake.wait()
            self._wake.clear()
            while self._wanted:
                owner, robot = next(iter(self._wanted))
                del self._wanted[owner, robot]
                try:
                    await self._fetch(owner, robot)
                except PeerGoneError:
                    self._newest.pop(robot, None)
                except GatewayError as error:  # its next change, or its link's next beginning, tries again
                    log.warning("the graph of robot %s cannot be had from gateway %s: %s", robot, owner, error)
                    self._newest.pop(robot, None)

    async def _fetch(self, owner: str, robot: str) -> None:
        answer = await self._mesh.request(owner, WHOLE, robot.encode(), timeout_s=WHOLE_S)
        if not answer or self._robots.has(robot):
            self._newest.pop(robot, None)
            return
        relayed = RelayedFrame.unpack(answer)
        known, number = self._received.get(robot, ("", 0))
        if known == owner and number >= relayed.number:
            return  # it was told anew meanwhile
        coming = self._received[robot] = (owner, -1)
        for part in split(relayed.frame):
            self._feature.on_frame(robot, link_pb2.AgentFrame.FromString(part))
            await asyncio.sleep(0)  # a piece is what may be read in one go
            if self._received.get(robot) is not coming:
                return  # told anew, or linked elsewhere, while this was read
        self._received[robot] = (owner, relayed.number)
        if self._newest.pop(robot, 0) > relayed.number:
            self._want(owner, robot, 0)
