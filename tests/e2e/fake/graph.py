"""The graph of the fake robots: which nodes publish, subscribe and serve what, and what their types are made of."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from typing import Any

from fastapi import FastAPI
from fastapi.responses import JSONResponse, Response, StreamingResponse

from gateway.fleet.ros.shapes import shape_of
from metaros.errors import UnknownTypeError
from metaros.idl import default_catalogue, type_hash
from metaros.wire import qos_default, qos_sensor_data
from tests.e2e.fake.robots import TOPICS, FakeRobot

__all__ = ["FakeGraph"]

READERS = {
    "note": ["watchdog"],
    "odom": ["planner"],
    "scan": ["mapper", "planner"],
    "imu": ["mapper"],
    "battery_state": ["watchdog"],
}
SERVICES = (
    ("base/resume", "std_srvs/srv/Trigger", "base"),
    ("base/set_light", "std_srvs/srv/SetBool", "base"),
    ("planner/set_parameters", "rcl_interfaces/srv/SetParameters", "planner"),
)


def node_of(topic: str) -> str:
    """Which node publishes it."""
    return {"odom": "base", "battery_state": "base", "motor_temperature": "base", "cmd_vel": "planner"}.get(
        topic, topic.split("/")[0]
    )


class FakeGraph:
    """Routes about types and graphs, publishing and calling; what was asked is kept."""

    def __init__(self, robots: list[FakeRobot]) -> None:
        self.robots = robots
        self.published: list[dict[str, Any]] = []
        self.tickets: list[dict[str, Any]] = []
        self.known = True
        self.healthy = False  # whether all gets through; then nobody drives
        self.actions: list[tuple[str, str]] = []  # with navigate
        self.goals: list[dict[str, Any]] = []
        self.goal_events: list[tuple[str, dict[str, Any]]] = []  # what is told of every goal, in order
        self.cancelled: list[str] = []
        self.goals_known = True

    def add_routes(self, app: FastAPI) -> None:
        """Serve them."""
        app.add_api_route("/api/v1/robots/{robot_id}/types/{package}/{kind}/{name}", self._type)
        app.add_api_route("/api/v1/robots/{robot_id}/graph", self._graph)
        app.add_api_route("/api/v1/graph", self._graphs)
        app.add_api_route("/api/v1/auth/tickets", self._ticket, methods=["POST"])
        app.add_api_route("/api/v1/robots/{robot_id}/actions/{action:path}", self._begin, methods=["POST"])
        app.add_api_route("/api/v1/robots/{robot_id}/goals/{goal}/feedback", self._follow)
        app.add_api_route("/api/v1/robots/{robot_id}/goals/{goal}/cancel", self._cancel, methods=["POST"])
        app.add_api_route("/api/v1/robots/{robot_id}/publish", self._publish, methods=["POST"])

    def describe(self, robot: FakeRobot) -> dict[str, Any]:
        """The contract's graph of a robot."""
        if not self.known:
            none: dict[str, Any] = {"nodes": [], "topics": [], "services": [], "actions": [], "left_out": 0}
            return {"robot": robot.id, "revision": 0, **none}
        names = {*(node_of(topic.name) for topic in TOPICS), *(node for each in READERS.values() for node in each)}
        topics = []
        for topic in sorted(TOPICS, key=lambda each: each.name):
            kind = (topic.type, (qos_sensor_data if topic.kind == "live" else qos_default).encode())
            out = [_end(robot, node_of(topic.name), *kind)] if topic.rate_hz or topic.name == "cmd_vel" else []
            into = [_end(robot, node, *kind) for node in READERS.get(topic.name, [])]
            if topic.name == "cmd_vel":
                into, out = [_end(robot, "base", *kind)], [] if self.healthy else out
            if topic.name == "note" and not self.healthy:  # it asks for more than is offered
                into = [_end(robot, "watchdog", topic.type, qos_default.encode())]
            row = {"topic": robot.topic(topic.name), "types": [topic.type], "publishers": out, "subscribers": into}
            topics.append(row)
        services = [
            {"service": robot.topic(name), "type": kind, "type_hash": type_hash(kind), "nodes": [], "clients": []}
            | {"servers": [_end(robot, node, kind, qos_default.encode())]}
            for name, kind, node in SERVICES
        ]
        action = {"action": robot.topic("navigate"), "type": "nav2_msgs/action/NavigateToPose"}
        action |= {"servers": [robot.topic("planner")], "clients": [robot.topic("watchdog")]}
        more = [
            {"action": robot.topic(name), "type": kind, "servers": [robot.topic("base")], "clients": []}
            for name, kind in self.actions
        ]
        nodes = [robot.topic(name) for name in sorted(names)]
        graph = {"robot": robot.id, "revision": 7, "nodes": nodes, "topics": topics, "services": services}
        return graph | {"actions": [action, *more], "left_out": 0}

    async def _graph(self, robot_id: str) -> dict[str, Any]:
        return self.describe(next(robot for robot in self.robots if robot.id == robot_id))

    async def _graphs(self) -> dict[str, Any]:
        return {"robots": [self.describe(robot) for robot in self.robots if self.known], "next": None}

    async def _type(self, robot_id: str, package: str, kind: str, name: str) -> Response:
        try:
            return JSONResponse(shape_of(f"{package}/{kind}/{name}", default_catalogue()))
        except UnknownTypeError as error:
            return JSONResponse({"code": "unknown_type", "detail": str(error), "status": 400}, 400)

    async def _ticket(self, body: dict[str, Any]) -> dict[str, Any]:
        self.tickets.append(body)
        return {"ticket": f"mrt_{len(self.tickets)}", "expires": "2026-11-22T12:00:00Z"}

    async def _begin(self, robot_id: str, action: str, body: dict[str, Any]) -> dict[str, Any]:
        self.goals.append({"robot": robot_id, "action": action, **body})
        return {"goal": "ab" * 16, "status": "accepted", "ended": False}

    async def _follow(self, robot_id: str, goal: str) -> Response:
        if not self.goals_known:
            return JSONResponse({"code": "unknown_goal", "detail": "there is no such goal", "status": 404}, 404)

        async def reported() -> AsyncIterator[str]:
            sent = 0
            while True:
                for kind, event in self.goal_events[sent:]:
                    sent += 1
                    yield f"event: {kind}\ndata: {json.dumps({'goal': goal, 'message': '', **event})}\n\n"
                    if kind == "result":
                        return
                await asyncio.sleep(0.02)

        return StreamingResponse(reported(), media_type="text/event-stream")

    async def _cancel(self, robot_id: str, goal: str) -> dict[str, Any]:
        self.cancelled.append(goal)
        return {"canceling": True}

    async def _publish(self, robot_id: str, body: dict[str, Any]) -> dict[str, Any]:
        self.published.append({"robot": robot_id, **body})
        return {"ok": True}


def _end(robot: FakeRobot, node: str, type_name: str, qos: str) -> dict[str, Any]:
    return {"node": robot.topic(node), "type": type_name, "type_hash": "", "qos": qos}
