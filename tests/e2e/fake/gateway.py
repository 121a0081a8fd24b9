"""A small gateway for the browser tests: it speaks the real REST and WebSocket contract about fake robots.

One serves many tests, each of which begins it anew: to make its routes and to start it takes longer than most tests.
"""

from __future__ import annotations

import asyncio
import datetime
import fnmatch
import json
import math
import struct
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import uvicorn
from fastapi import FastAPI, WebSocket, WebSocketDisconnect
from fastapi.responses import JSONResponse, Response
from uvicorn.server import ServerState

from gateway.api.middleware.static import Dashboard
from gateway.api.views.identity import account_view
from gateway.domain.principal import EVERY_ROBOT, Principal, Role
from metaros.clock import SystemClock
from tests.e2e.fake.alerts import FakeAlerts
from tests.e2e.fake.functions import FakeFunctions
from tests.e2e.fake.graph import FakeGraph
from tests.e2e.fake.history import FakeHistory
from tests.e2e.fake.recordings import FakeRecordings
from tests.e2e.fake.robots import FakeRobot, FakeTopic
from tests.e2e.fake.rules import FakeRules

__all__ = ["STATIC", "FakeGateway", "account"]

STATIC = Path(__file__).resolve().parents[3] / "gateway" / "static"


def account(role: Role, *, name: str = "ada") -> dict[str, Any]:
    """What /auth/me answers to a user of that role; nobody signs in here."""
    principal = Principal(kind="user", id="U1", name=name, role=role, robots=EVERY_ROBOT, csrf="fake")
    return account_view(principal, has_password=True)


class FakeGateway:
    """Serves the built dashboard and the contract on one port; stops and starts again like a restarted gateway."""

    def __init__(self, port: int, robots: list[FakeRobot]) -> None:
        self.port = port
        self._clock = SystemClock()
        self.history = FakeHistory(robots, self.seconds)
        self.recordings = FakeRecordings(self.seconds)
        self.alerts = FakeAlerts(robots, self.recordings, self.seconds)
        self.graph = FakeGraph(robots)
        self.functions = FakeFunctions(self.seconds)
        self.rules = FakeRules(self.seconds)
        self._server: uvicorn.Server | None = None
        self._thread: threading.Thread | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._set(robots)
        self._app = self._made_app()

    def _set(self, robots: list[FakeRobot]) -> None:
        self.robots = robots
        self.teleop: list[dict[str, Any]] = []
        self.called: list[dict[str, Any]] = []
        self.watched: list[str] = []  # topics that a page follows now, once a subscription
        self.lease_holder: str | None = None
        self.refuses_uplink = False
        self.account = account(Role.OPERATOR)

    def begin(self, robots: list[FakeRobot]) -> None:
        """Serve as if new, with these robots: nobody is connected, and nothing is left of what was."""
        self.start()
        self.leave()
        self._set(robots)
        for part, fresh in (
            (self.history, FakeHistory(robots, self.seconds)),
            (self.recordings, FakeRecordings(self.seconds)),
            (self.alerts, FakeAlerts(robots, self.recordings, self.seconds)),
            (self.graph, FakeGraph(robots)),
            (self.functions, FakeFunctions(self.seconds)),
            (self.rules, FakeRules(self.seconds)),
        ):
            vars(part).clear()  # the routes know it, so it stays
            vars(part).update(vars(fresh))

    @property
    def url(self) -> str:
        """The address of its front page."""
        return f"http://127.0.0.1:{self.port}"

    def start(self) -> None:
        """Serve in a thread of its own; returns when it answers, also if it served already."""
        if self._server is not None:
            return
        config = uvicorn.Config(self._app, port=self.port, log_level="error", ws="websockets-sansio", lifespan="off")
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._run, args=(self._server,), daemon=True)
        self._thread.start()
        pause = threading.Event()
        for _ in range(500):
            if self._server.started:
                return
            pause.wait(0.01)
        raise RuntimeError("the fake gateway did not start")

    def _run(self, server: uvicorn.Server) -> None:
        with asyncio.Runner(loop_factory=server.config.get_loop_factory()) as runner:
            self._loop = runner.get_loop()
            runner.run(server.serve())

    def leave(self) -> None:
        """End every connection, and wait until nothing is done for any of them."""
        if self._server is not None and self._loop is not None:
            asyncio.run_coroutine_threadsafe(self._leave(self._server.server_state), self._loop).result(60)

    async def _leave(self, state: ServerState) -> None:
        for connection in list(state.connections):
            connection.transport.abort()
        while state.tasks:
            await asyncio.wait(set(state.tasks))

    def stop(self) -> None:
        """End it and every connection, at once."""
        if self._server is None or self._thread is None:
            return
        self._server.should_exit = True
        self._server.force_exit = True
        self._thread.join(60)
        self._server = self._thread = None

    def seconds(self) -> float:
        """Its wall clock."""
        return self._clock.wall_ns() / 1e9

    def described(self) -> list[dict[str, Any]]:
        """All robots, as the contract has them."""
        now = datetime.datetime.fromtimestamp(self.seconds(), datetime.UTC).isoformat()
        return [robot.describe(now) for robot in self.robots]

    def _robot(self, robot_id: str) -> FakeRobot:
        return next(robot for robot in self.robots if robot.id == robot_id)

    def _made_app(self) -> FastAPI:
        app = FastAPI(openapi_url=None)
        app.add_api_route("/api/v1/auth/me", lambda: self.account)
        app.add_api_route("/api/v1/auth/oidc", lambda: {"name": None, "url": None})
        app.add_api_route("/api/v1/robots", lambda: {"robots": self.described()})
        app.add_api_route("/api/v1/robots/{robot_id}/topics", self._topics)
        app.add_api_route("/api/v1/robots/{robot_id}/metrics", self._metrics)
        app.add_api_route("/api/v1/robots/{robot_id}/services/call", self._call, methods=["POST"])
        app.add_api_route("/api/v1/robots/{robot_id}/gaps", self._gaps)
        app.add_api_route("/api/v1/robots/{robot_id}/uplink", self._uplink, methods=["PUT"])
        self.history.add_routes(app)
        self.recordings.add_routes(app)
        self.alerts.add_routes(app)
        self.graph.add_routes(app)
        self.functions.add_routes(app)
        self.rules.add_routes(app)
        app.add_api_websocket_route("/api/v1/stream", self._stream)
        app.add_api_websocket_route("/api/v1/robots/{robot_id}/teleop", self._drive)
        app.mount("/", Dashboard(STATIC))
        return app

    async def _topics(self, robot_id: str) -> dict[str, Any]:
        robot = self._robot(robot_id)
        return {"topics": [robot.describe_topic(i, topic) for i, topic in enumerate(robot.topics, 1)]}

    async def _metrics(self, robot_id: str) -> dict[str, Any]:
        names = self._robot(robot_id).metrics(0.0)
        rows = ({"name": name, "topic": "", "field": "", "samples": 1, "latest": None} for name in names)
        return {"series": list(rows)}

    async def _call(self, robot_id: str, body: dict[str, Any]) -> dict[str, Any]:
        self.called.append({"robot": robot_id, **body})
        return {"response": {"success": True, "message": ""}}

    async def _gaps(self, robot_id: str) -> dict[str, Any]:
        now = datetime.datetime.fromtimestamp(self.seconds() - 65, datetime.UTC).isoformat()
        return {"gaps": self._robot(robot_id).describe_gaps(now)}

    async def _uplink(self, robot_id: str, body: dict[str, Any]) -> Response:
        if self.refuses_uplink:
            return JSONResponse({"code": "unsupported", "detail": "this agent is too old", "status": 501}, 501)
        self._robot(robot_id).budget_bytes_per_s = body["bytes_per_s"]
        return JSONResponse({"bytes_per_s": body["bytes_per_s"], "sent_bytes_per_s": 0.0})

    async def _drive(self, socket: WebSocket, robot_id: str) -> None:
        await socket.accept()
        try:
            while True:
                said = await socket.receive_json()
                self.teleop.append(said)
                if said["op"] == "take" and self.lease_holder is not None:
                    await socket.send_json({"op": "refused", "code": "lease_taken", "holder": self.lease_holder})
                elif said["op"] == "take":
                    topic = self._robot(robot_id).topic("cmd_vel")
                    await socket.send_json({"op": "granted", "lease_id": "L1", "expires_in_s": 1.0, "topic": topic})
                elif said["op"] == "drive":
                    await socket.send_json({"op": "ack", "seq": said["seq"], "rtt_ms": 1.5})
        except WebSocketDisconnect:
            self.teleop.append({"op": "closed"})

    async def _stream(self, socket: WebSocket) -> None:
        await socket.accept()
        await socket.send_json({"op": "welcome", "protocol": 1, "gateway_id": "fake", "limits": {}})
        running: dict[int, asyncio.Task[None]] = {}
        try:
            while True:
                said = json.loads(await socket.receive_text())
                if said["op"] == "unsubscribe":
                    task = running.pop(said["id"], None)
                    if task is not None:
                        task.cancel()
                else:
                    running[said["id"]] = asyncio.create_task(self._feed(socket, said))
        except WebSocketDisconnect:
            pass
        finally:
            for task in running.values():
                task.cancel()
            await asyncio.gather(*running.values(), return_exceptions=True)

    async def _feed(self, socket: WebSocket, wanted: dict[str, Any]) -> None:
        feeds: dict[str, Callable[..., Any]] = {
            "subscribe": self._feed_topic,
            "subscribe_metrics": self._feed_metrics,
            "subscribe_fleet": self._feed_fleet,
        }
        await feeds[wanted["op"]](socket, wanted)

    async def _feed_fleet(self, socket: WebSocket, wanted: dict[str, Any]) -> None:
        while True:
            await socket.send_json({"op": "fleet", "id": wanted["id"], "robots": self.described()})
            await asyncio.sleep(0.5)

    async def _feed_metrics(self, socket: WebSocket, wanted: dict[str, Any]) -> None:
        while True:
            now = self.seconds()
            for robot in self.robots:
                if robot.state == "online" and fnmatch.fnmatch(robot.id, wanted["robots"]):
                    values = {n: v for n, v in robot.metrics(now).items() if n in wanted["series"]}
                    notice = {"op": "metrics", "id": wanted["id"], "robot": robot.id, "stamp_ms": now * 1000}
                    await socket.send_json(notice | {"values": values})
            await asyncio.sleep(0.5)

    async def _feed_topic(self, socket: WebSocket, wanted: dict[str, Any]) -> None:
        self.watched.append(wanted["topics"])
        try:
            await self._send_topic(socket, wanted)
        finally:
            self.watched.remove(wanted["topics"])

    async def _send_topic(self, socket: WebSocket, wanted: dict[str, Any]) -> None:
        for robot in self.robots:
            for number, topic in enumerate(robot.topics, 1):
                if robot.id == wanted["robots"] and robot.topic(topic.name) == wanted["topics"] and topic.rate_hz:
                    await socket.send_json(robot.describe_channel(number, topic))
                    rate_hz = min(topic.rate_hz, wanted.get("max_rate_hz") or math.inf)
                    await self._send_records(socket, wanted["id"], robot, (number, topic), rate_hz)

    async def _send_records(
        self, socket: WebSocket, subscription: int, robot: FakeRobot, channel: tuple[int, FakeTopic], rate_hz: float
    ) -> None:
        number, topic = channel
        seq = 0
        while True:
            seq += 1
            now = self.seconds()
            if payload := robot.encode(topic, now):  # else it is lost on its way
                padded = -(-len(payload) // 8) * 8
                stamp_ns = int(now * 1e9)
                sizes = (40 + padded, subscription, number, len(payload))
                await socket.send_bytes(
                    struct.pack("<IIIIQqq", *sizes, seq, stamp_ns, stamp_ns) + payload.ljust(padded, b"\0")
                )
            await asyncio.sleep(1 / rate_hz)


def _serve() -> None:
    """`python -m tests.e2e.fake.gateway`: three robots on port 8090, to look at the pages."""
    robots = [
        FakeRobot("sim_1", "/sim_1"),
        FakeRobot("sim_2", "/sim_2", phase=2.0, battery=0.14),
        FakeRobot("sim_3", "/sim_3", phase=4.0),
    ]
    gateway = FakeGateway(8090, [*robots, FakeRobot("bench", "/", state="offline")])
    gateway.start()
    print(gateway.url)
    threading.Event().wait()


if __name__ == "__main__":
    _serve()
