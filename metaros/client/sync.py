"""The client that blocks; see `metaros.client`."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

import grpc

from metaros._proto import alerts_pb2_grpc, events_pb2_grpc, fleet_pb2_grpc, telemetry_pb2, telemetry_pb2_grpc
from metaros.client import requests, rpc
from metaros.client.access import find_access
from metaros.client.alerts_sync import Alerts
from metaros.client.drive import Drive
from metaros.client.goal import Goal
from metaros.client.http import Http
from metaros.client.results import Command, Event, GoalUpdate, Robot, Sample, Series, Values
from metaros.client.retries import Retries, StreamRetries
from metaros.clock import SystemClock, system_rng
from metaros.errors import MetarosError, PeerError, UnavailableError

__all__ = ["Client"]

Names = str | Sequence[str]
Reply = TypeVar("Reply")
NO_WAIT_S = 0.0


class Client:
    """A gateway. Use it in a `with` block, or `close` it; it may be used from several threads."""

    def __init__(
        self,
        gateway: str = "",
        *,
        key: str | None = None,
        ca: str | Path | None = None,
        grpc_target: str = "",
        timeout_s: float = 30.0,
        retries: Retries | None = None,
    ) -> None:
        """What is not given is found as the command line finds it, see `metaros.client.access`.

        Args:
            gateway: the address of its HTTP port, like `https://fleet.example`.
            key: an API key, "" for nobody's.
            ca: a file of root certificates that alone are believed.
            grpc_target: `host:port` of its gRPC port for programs, where a proxy has it elsewhere.
            timeout_s: of a request; streams last as long as they are read.
            retries: of what is safe to repeat.

        Raises:
            ConfigError: the address is none, or the user's files cannot be read.
        """
        self.access = find_access(gateway, key=key, ca=ca)
        self._retries = retries or Retries()
        self._http = Http(self.access, timeout_s=timeout_s, retries=self._retries)
        self._target, self._timeout_s, self._rng = grpc_target, timeout_s, system_rng()
        self._channel: grpc.Channel | None = None
        self.alerts = Alerts(self._http, self._follow_alerts)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End its connections, and with them its streams."""
        self._http.close()
        if self._channel is not None:
            self._channel.close()

    def robots(self, *, selector: str | None = None) -> list[Robot]:
        """Every robot in scope, by id; of those that `selector` names, like `site=lab`."""
        found: list[Robot] = []
        after: Any = None
        while True:
            page, after = self._http.send(requests.robots(selector=selector, after=after))
            found += page
            if after is None:
                return found

    def robot(self, robot: str) -> Robot:
        """One robot."""
        return self._http.send(requests.get(requests.robot_path(robot), Robot.of))

    def publish(
        self,
        robot: str,
        topic: str,
        message: Any,
        *,
        type_name: str = "",
        lease_id: str = "",
        sent_ns: int = 0,
        timeout_s: float | None = None,
    ) -> None:
        """Publish once on a robot: a message of a message class, or its values as a mapping. Never sent twice.

        `type_name` may be left out where the robot announces the topic. Returns when the robot's agent has done it.
        """
        self._http.send(
            requests.publish(
                robot, topic, message, type_name=type_name, lease_id=lease_id, sent_ns=sent_ns, timeout_s=timeout_s
            )
        )

    def call(
        self,
        robot: str,
        service: str,
        request: Mapping[str, Any] | None = None,
        *,
        type_name: str = "",
        timeout_s: float = 10.0,
        lease_id: str = "",
    ) -> Any:
        """Call a service of a robot; its answer as a mapping. Never sent twice."""
        asked = requests.call(
            robot, service, request or {}, type_name=type_name, timeout_s=timeout_s, lease_id=lease_id
        )
        return self._http.send(asked)

    def send_goal(
        self,
        robot: str,
        action: str,
        goal: Mapping[str, Any] | None = None,
        *,
        type_name: str = "",
        timeout_s: float = 10.0,
        lease_id: str = "",
    ) -> Goal:
        """Start an action: iterate over how it goes, or wait for its `result()`. Never sent twice.

        Raises:
            RefusedError: the robot, the action or its type is not known, or the goal does not fit.
        """
        request = rpc.goal_request(robot, action, goal, type_name=type_name, timeout_s=timeout_s, lease_id=lease_id)
        replies = self._stream(self._telemetry().SendGoal, request)
        first = next(replies, None)
        if first is None:
            raise PeerError("the gateway said nothing of the goal")

        def updates() -> Iterator[GoalUpdate]:
            yield rpc.goal_update(first)
            for reply in replies:
                yield rpc.goal_update(reply)

        return Goal(first.goal, updates(), lambda goal_id: self._cancel_goal(robot, goal_id))

    def subscribe(
        self,
        topics: Names | None = None,
        *,
        robots: Names | None = None,
        series: Names | None = None,
        rate_hz: float = 0.0,
        latest: bool = False,
        queue_bytes: int = 0,
        decode: bool = True,
    ) -> Iterator[Sample | Values]:
        """Samples as they arrive, and newest values of series, of robots and names by pattern; end it by leaving it.

        A relative topic counts in each robot's namespace. At most `rate_hz` a second of each channel, 0 for all;
        `latest` has only the newest wait for a slow reader, else up to `queue_bytes` (1 MiB), the oldest goes first.
        After a loss of the connection it begins again, without what came meanwhile: a hole in a topic's `seq` is what
        was lost, to the slow reader too.
        """
        asked = rpc.subscribe_request(topics, series, robots, rate_hz=rate_hz, latest=latest, queue_bytes=queue_bytes)
        for reply, samples in self._again(lambda: self._telemetry().Subscribe, lambda: asked, decode=decode):
            yield from samples.live(reply)

    def history(
        self,
        robot: str,
        topics: Names | None = None,
        *,
        start: str = "-15m",
        end: str = "now",
        limit: int = 0,
        newest_first: bool = False,
        decode: bool = True,
    ) -> Iterator[Sample]:
        """Stored messages of a range in order of their stamps; times are RFC 3339, relative as -15m, or now."""
        samples = rpc.Samples(decode=decode)
        request = rpc.query_request(robot, topics, start, end, limit=limit, newest_first=newest_first)
        for reply in self._stream(self._telemetry().Query, request):
            yield from samples.stored(reply)

    def query(
        self, robot: str, series: Names, *, start: str = "-15m", end: str = "now", points: int = 500
    ) -> dict[str, Series]:
        """Series over a time, by name, at most so many points of each."""
        return self._http.send(requests.series(robot, series, start=start, end=end, points=points))

    def metrics(self, robot: str) -> list[Any]:
        """The robot's stored series, each with its newest value."""
        return self._http.send(requests.metrics(robot))

    def snapshot(self, robot: str) -> Any:
        """The newest message of each of the robot's topics, and its newest values."""
        return self._http.send(requests.get(requests.robot_path(robot, "/snapshot"), dict))

    def command(
        self,
        robot: str,
        kind: str,
        request: Mapping[str, Any] | None = None,
        *,
        wait_s: float = NO_WAIT_S,
        idempotency_key: str = "",
        **options: Any,
    ) -> Command:
        """Have a robot do something; `wait_s` for its end, at most 60. `durable=True` waits for a robot that is away.

        It carries a key by which the gateway knows it again, so that it is sent again where an answer got lost.
        """
        key = idempotency_key or uuid.uuid4().hex
        asked = requests.command(robot, kind, request or {}, key=key, wait_s=wait_s, options=options)
        return self._http.send(asked)

    def twin(self, robot: str) -> Any:
        """The robot's desired and reported state."""
        return self._http.send(requests.get(requests.robot_path(robot, "/twin"), dict))

    def change_twin(self, robot: str, patch: Mapping[str, Any]) -> Any:
        """Change the robot's own document by a JSON merge patch; what the gateway says of the change."""
        return self._http.send(requests.merge(requests.robot_path(robot, "/twin"), dict(patch)))

    def recordings(self, robot: str | None = None, *, limit: int = 100) -> list[Any]:
        """The newest recordings, of one robot or of all."""
        wanted = requests.get("/api/v1/recordings", lambda answer: list(answer["recordings"]), robot=robot, limit=limit)
        return self._http.send(wanted)

    def events(
        self, *, after: int | None = None, kinds: Names | None = None, robots: Names | None = None
    ) -> Iterator[Event]:
        """What happens in the fleet, from now on or behind a cursor; a loss of the connection loses none."""
        place = rpc.EventPosition(after, kinds, robots)
        for reply, _ in self._again(self._watch_events, place.request):
            yield from place.events(reply)

    @contextmanager
    def drive(self, robot: str, *, holder: str = "metaros.client") -> Iterator[Drive]:
        """Drive a robot while the block runs: `drive.move(linear=…, angular=…)`. Its end stops the robot.

        Raises:
            RefusedError: `lease_taken`, where somebody else drives.
        """
        drive = Drive(robot, holder)
        call = fleet_pb2_grpc.FleetServiceStub(self._opened()).Drive
        try:
            drive.open(lambda requests: call(requests, metadata=self._metadata()))
            yield drive
            drive.close()
        except grpc.RpcError as error:
            raise rpc.refusal(error) from error
        finally:
            drive.cancel()

    def _cancel_goal(self, robot: str, goal_id: str) -> bool:
        request = telemetry_pb2.CancelGoalRequest(robot=robot, goal=goal_id)
        try:
            answer = self._telemetry().CancelGoal(request, metadata=self._metadata(), timeout=self._timeout_s)
        except grpc.RpcError as error:
            raise rpc.refusal(error) from error
        return bool(answer.canceling)

    def _again(
        self, call: Callable[[], Any], request: Callable[[], Any], *, decode: bool = True
    ) -> Iterator[tuple[Any, rpc.Samples]]:
        """A stream's replies; begun again when the connection is lost, as `retries` says."""
        tries = StreamRetries(self._retries, rng=self._rng, clock=SystemClock())
        while True:
            samples = rpc.Samples(decode=decode)
            try:
                for reply in self._stream(call(), request()):
                    tries.went()
                    yield reply, samples
                return
            except MetarosError as error:
                if self._http.pause(tries.wait_s(error)):
                    raise  # closed: nothing is begun again

    def _stream(self, call: Any, request: Any) -> Iterator[Any]:
        """The replies of a call, whose errors are ours; leaving it ends the call."""
        try:
            replies = call(request, metadata=self._metadata())
        except ValueError as error:  # gRPC's word for a channel that was closed
            raise UnavailableError("the client is closed") from error
        try:
            yield from replies
        except grpc.RpcError as error:
            raise rpc.refusal(error) from error
        finally:
            replies.cancel()

    def _telemetry(self) -> Any:
        return telemetry_pb2_grpc.TelemetryServiceStub(self._opened())

    def _follow_alerts(self, request: Any) -> Iterator[Any]:
        return (reply for reply, _ in self._again(self._watch_alerts, lambda: request))

    def _watch_alerts(self) -> Any:
        return alerts_pb2_grpc.AlertServiceStub(self._opened()).WatchAlerts

    def _watch_events(self) -> Any:
        return events_pb2_grpc.EventServiceStub(self._opened()).WatchEvents

    def _metadata(self) -> list[tuple[str, str]]:
        return list(self.access.headers.items())

    def _opened(self) -> grpc.Channel:
        """The channel, made when it is wanted first: the gateway says on which port."""
        if self._channel is None:
            if not self._target:
                self._target = f"{self.access.host}:{self._http.send(requests.programs_port())}"
            self._channel = rpc.channel(self.access, self._target)
        return self._channel
