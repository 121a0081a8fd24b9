"""A model of a robot's agent as far as twins go: what it does with desired documents, over links that break."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field

from gateway.errors import RobotOfflineError
from metaros._proto import link_pb2

__all__ = ["ModelFleet", "ModelRobot"]


@dataclass
class ModelRobot:
    """Applies what it is sent, reports it as confirming, and keeps it once confirmed, as edge_agent/twin does."""

    name: str
    labels: dict[str, str] = field(default_factory=dict)
    online: bool = False
    newest: int = 0  # the newest revision it has seen
    applied: int = 0
    document: bytes = b"{}"
    state: str = "applied"
    before: tuple[int, bytes] | None = None  # what it goes back to
    inbox: list[link_pb2.GatewayFrame] = field(default_factory=list)
    seen: list[int] = field(default_factory=list)  # revisions it was sent

    def report(self) -> link_pb2.TwinReport:
        """What it says of itself now."""
        return link_pb2.TwinReport(
            revision=self.newest,
            applied=self.applied,
            state=self.state,
            sha256=hashlib.sha256(self.document).digest(),
            reported=json.dumps({"documents": len(self.seen)}).encode(),
        )

    def take(self, frame: link_pb2.GatewayFrame) -> bool:
        """Do what a frame says; whether that is worth a report."""
        kind = frame.WhichOneof("frame")
        if kind == "twin":
            twin = frame.twin
            assert hashlib.sha256(twin.document).digest() == twin.sha256
            self.seen.append(twin.revision)
            if twin.revision <= self.newest:
                return False
            if self.before is None:
                self.before = self.applied, self.document
            self.newest = self.applied = twin.revision
            self.document, self.state = twin.document, "confirming"
            return True
        assert kind == "twin_confirmed"
        if self.state != "confirming" or frame.twin_confirmed.revision != self.newest:
            return False
        self.before, self.state = None, "applied"
        return True

    def window_over(self) -> bool:
        """No confirmation came in time: back to what was confirmed last."""
        if self.state != "confirming" or self.before is None:
            return False
        (self.applied, self.document), self.before, self.state = self.before, None, "reverted"
        return True


class ModelFleet:
    """Robots by name, and the `send` that a gateway has to them."""

    def __init__(self) -> None:
        self.robots: dict[str, ModelRobot] = {}

    def add(self, name: str, **labels: str) -> ModelRobot:
        """A robot that is not linked yet."""
        robot = self.robots[name] = ModelRobot(name, labels)
        return robot

    def send(self, name: str, frame: link_pb2.GatewayFrame) -> None:
        """Put a frame on its control lane."""
        if not self.robots[name].online:
            raise RobotOfflineError(f"robot {name} has no link now")
        self.robots[name].inbox.append(link_pb2.GatewayFrame.FromString(frame.SerializeToString()))

    def said(self, name: str) -> dict[str, str]:
        """The labels of its Hello."""
        return self.robots[name].labels
