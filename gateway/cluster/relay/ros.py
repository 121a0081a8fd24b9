"""Robots' ROS graphs and goals at every gateway, and what clients of any gateway serve in them.

A robot's home tells all others what its agent reports, as it comes. Graphs come as changes, each with the number after
the one before: a gateway that misses one, or comes later, asks the home for the whole.
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
from gateway.cluster.relay_offers import OfferMerge
from gateway.cluster.relay_wire import Parcel, join, split
from gateway.errors import GatewayError, RobotOfflineError
from metaros._proto import link_pb2

__all__ = ["Graphs", "OpenGoals", "Robots", "RosRelay", "RosSide", "TellOne"]

log = logging.getLogger(__name__)

TOLD, KNOWN, WHOLE = "ros.told", "ros.known", "ros.whole"
KNOWN_AT_ONCE = 1000
WHOLE_S = 10.0


class Graphs(Protocol):
    """What robots told of their graphs."""

    def known(self) -> list[str]:
        """The robots that told something."""

    def knows(self, robot_id: str) -> bool:
        """Whether one is kept, whole or not."""

    def reports(self, robot_id: str) -> list[link_pb2.GraphReport]:
        """All of one, as its agent would tell it anew."""


class OpenGoals(Protocol):
    """The goals of robots."""

    def told(self, robot_id: str) -> link_pb2.GoalEvents:
        """How the open ones stand."""


class RosSide(Protocol):
    """The gateway's own part for ROS graphs."""

    @property
    def graphs(self) -> Graphs:
        """What robots told."""

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


class TellOne(Protocol):
    """Tells one other gateway something of a robot that is linked here."""

    def __call__(self, gateway: str, robot: str, frame: link_pb2.AgentFrame) -> None:
        """Soon, in order."""


class RosRelay:
    """Lives on the event loop; `run` asks for what is missing."""

    def __init__(self, mesh: Mesh, robots: Robots, side: RosSide) -> None:
        self._mesh = mesh
        self._robots = robots
        self._side = side
        self.tell_one: TellOne = lambda gateway, robot, frame: None
        self._merge = OfferMerge()
        self._numbers: Counter[str] = Counter()  # of the reports of robots that are linked here
        self._heard: dict[str, tuple[str, int]] = {}  # of others: from which gateway, and the last number
        self._newest: dict[str, int] = {}  # the highest number that was seen, of those that are asked for
        self._wanted: dict[tuple[str, str], None] = {}  # home and robot
        self._wake = asyncio.Event()
        mesh.on_tell(TOLD, self._on_told)
        mesh.on_tell(KNOWN, self._on_known)
        mesh.on_ask(WHOLE, self._on_whole)
        mesh.on_peer(self._on_peer)

    # -- robots that are linked here --------------------------------------------------------------------------------

    def on_frame(self, robot: str, frame: link_pb2.AgentFrame) -> None:
        """A robot's agent says something of its graph, of goals or of offers."""
        kind = frame.WhichOneof("frame")
        if kind in ("graph", "goals"):
            self._side.on_frame(robot, frame)
            self._numbers[robot] += kind == "graph"
            self._mesh.tell_all(TOLD, Parcel(robot, frame.SerializeToString(), self._numbers[robot]).pack())
        elif kind == "offer_states":
            for gateway, states in self._merge.states(robot, frame.offer_states).items():
                self._tell(gateway, robot, link_pb2.AgentFrame(offer_states=states))
        elif kind == "asked":
            gateway = self._merge.asked(robot, frame.asked)
            self._tell(gateway or self._mesh.gateway_id, robot, frame)

    def on_online(self, robot: str, online: bool) -> None:
        """A link here began or ended."""
        if online:
            self._heard.pop(robot, None)
        else:
            self._merge.forget(robot)

    def put(self, robot: str, gateway: str, told: link_pb2.Offers) -> None:
        """What a gateway's clients serve on a robot that is linked here; RobotOfflineError."""
        refused = self._merge.put(robot, gateway, told)
        try:
            self._robots.send(robot, link_pb2.GatewayFrame(offers=self._merge.list_of(robot)))
        except RobotOfflineError:
            self._merge.forget(robot)
            raise
        if refused is not None:
            self._tell(gateway, robot, link_pb2.AgentFrame(offer_states=refused))

    def answered(self, robot: str, gateway: str, answer: link_pb2.OfferAnswer) -> bool:
        """Whether that gateway's client was asked."""
        return self._merge.answered(robot, gateway, answer)

    def _tell(self, gateway: str, robot: str, frame: link_pb2.AgentFrame) -> None:
        if gateway == self._mesh.gateway_id:
            self._side.on_frame(robot, frame)
        else:
            self.tell_one(gateway, robot, frame)

    async def _on_whole(self, sender: str, payload: bytes) -> bytes:
        """A robot's whole graph and its open goals; an empty answer where it is not linked here."""
        robot = payload.decode()
        if not self._robots.has(robot):
            return b""
        frames = [link_pb2.AgentFrame(graph=report) for report in self._side.graphs.reports(robot)]
        frames.append(link_pb2.AgentFrame(goals=self._side.goals.told(robot)))
        return Parcel(robot, join(frame.SerializeToString() for frame in frames), self._numbers[robot]).pack()

    # -- robots that are linked elsewhere ----------------------------------------------------------------------------

    def _on_told(self, sender: str, payload: bytes) -> None:
        parcel = Parcel.unpack(payload)
        robot = parcel.robot
        if self._robots.has(robot):
            return  # what an earlier home says is over
        frame = link_pb2.AgentFrame.FromString(parcel.frame)
        if frame.HasField("goals"):
            self._side.on_frame(robot, frame)
            return
        follows = self._heard.get(robot) == (sender, parcel.number - 1) and self._side.graphs.knows(robot)
        if frame.graph.anew or follows:
            self._heard[robot] = (sender, parcel.number)
            self._side.on_frame(robot, frame)
        else:
            self._want(sender, robot, parcel.number)

    def _on_known(self, sender: str, payload: bytes) -> None:
        for robot, number in json.loads(payload):
            if self._heard.get(robot) != (sender, number) and not self._robots.has(robot):
                self._want(sender, robot, number)

    def _on_peer(self, gateway: str, there: bool) -> None:
        if there:
            mine = [(robot, self._numbers[robot]) for robot in self._side.graphs.known() if self._robots.has(robot)]
            for start in range(0, len(mine), KNOWN_AT_ONCE):
                self._mesh.tell(gateway, KNOWN, json.dumps(mine[start : start + KNOWN_AT_ONCE]).encode())
            return
        self._heard = {robot: heard for robot, heard in self._heard.items() if heard[0] != gateway}
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

    def _want(self, home: str, robot: str, number: int) -> None:
        self._newest[robot] = max(number, self._newest.get(robot, 0))
        self._wanted[home, robot] = None
        self._wake.set()

    async def run(self) -> None:
        """Ask for whole graphs, one after another, until cancelled."""
        while True:
            await self._wake.wait()
            self._wake.clear()
            while self._wanted:
                home, robot = next(iter(self._wanted))
                del self._wanted[home, robot]
                try:
                    await self._fetch(home, robot)
                except PeerGoneError:
                    self._newest.pop(robot, None)
                except GatewayError as error:  # its next change, or its link's next beginning, tries again
                    log.warning("the graph of robot %s cannot be had from gateway %s: %s", robot, home, error)
                    self._newest.pop(robot, None)

    async def _fetch(self, home: str, robot: str) -> None:
        answer = await self._mesh.ask(home, WHOLE, robot.encode(), timeout_s=WHOLE_S)
        if not answer or self._robots.has(robot):
            self._newest.pop(robot, None)
            return
        parcel = Parcel.unpack(answer)
        known, number = self._heard.get(robot, ("", 0))
        if known == home and number >= parcel.number:
            return  # it was told anew meanwhile
        coming = self._heard[robot] = (home, -1)
        for part in split(parcel.frame):
            self._side.on_frame(robot, link_pb2.AgentFrame.FromString(part))
            await asyncio.sleep(0)  # a piece is what may be read in one go
            if self._heard.get(robot) is not coming:
                return  # told anew, or linked elsewhere, while this was read
        self._heard[robot] = (home, parcel.number)
        if self._newest.pop(robot, 0) > parcel.number:
            self._want(home, robot, 0)
