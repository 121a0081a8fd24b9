"""What the client of an open socket may do with robots: the façade that all socket protocols share.

Each action checks the permission table, the principal's scope, the robot's rate and, on actuators, the lease, exactly
as REST does for a request, and leaves its row in the audit log: one when a client begins to publish on a topic and one
with the count when it ends, not one a message. Names are those that the client uses, see `ClientNames`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from starlette.requests import HTTPConnection

from gateway.api.open_connections import OpenConnection
from gateway.api.services import Services
from gateway.domain.channel import Channel
from gateway.domain.client_names import ClientNames
from gateway.domain.principal import Principal
from gateway.errors import (
    ForbiddenError,
    InvalidRequestError,
    SignInError,
    TooManyError,
    TooManyRequestsError,
    UnknownRobotError,
)
from gateway.fleet.command_manager import NewCommand
from gateway.fleet.nodes.values import Parameter, SetResult
from gateway.fleet.nodes.verbs import Actor
from gateway.fleet.ros.goal import Goal
from gateway.fleet.ros.graph import RobotGraph
from gateway.fleet.ros.offer import JSON, Answer, Dialect, Execute, Offer
from gateway.fleet.twins.manager import Editor
from gateway.identity.permissions import permission
from gateway.ingest.registry import RobotRecord
from metaros.errors import MetarosError
from metaros.limits import LIMITS

__all__ = ["Publication", "ResolvedName", "RobotAccess", "Topic"]


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic that the client sees: what it calls it, and the robot's channel behind it."""

    shown: str
    channel: Channel


@dataclass(frozen=True, slots=True)
class ResolvedName:
    """What a client's name resolves to: a robot, and a full ROS name of it."""

    robot: str
    name: str


@dataclass(slots=True)
class Publication:
    """One topic that the client publishes on: how many messages went, and how many were refused."""

    resolved: ResolvedName
    type_name: str
    sent: int = 0
    refused: int = 0


@dataclass(slots=True)
class RobotAccess:
    """One client. All methods on the event loop; call `close` when its socket is over.

    Every method raises what REST would answer: SignInError, ForbiddenError, UnknownRobotError, TooManyRequestsError,
    LeaseRequiredError, InvalidRequestError, RobotError and the library's own.
    """

    services: Services
    connection: OpenConnection
    names: ClientNames
    target: str = ""  # the socket's path, for the audit log
    address: str = ""
    _publications: dict[ResolvedName, Publication] = field(default_factory=dict)
    _refused: set[tuple[str, str]] = field(default_factory=set)
    _turn: asyncio.Lock = field(default_factory=asyncio.Lock)  # held by a message that is being made: later ones wait

    @classmethod
    def of(
        cls, socket: HTTPConnection, services: Services, connection: OpenConnection, *, robot: str | None = None
    ) -> RobotAccess:
        """The client of a socket: of one robot, or of all that its principal sees.

        Raises:
            UnknownRobotError: that robot never connected, or is out of scope.
        """
        names = ClientNames(robot, sees=connection.principal.sees)
        if robot is not None:
            if not names.covers(robot):
                raise UnknownRobotError.of(robot)
            services.registry.get(robot)
        client = socket.scope.get("client")
        return cls(services, connection, names, target=socket.scope["path"], address=client[0] if client else "")

    @property
    def principal(self) -> Principal:
        """Who it is."""
        return self.connection.principal

    def may(self, action: str) -> bool:
        """Whether its role has the permission; scope is checked at each action."""
        return permission(action).granted(self.principal)

    def require(self, action: str, robot: str) -> None:
        """Return when it may do that to that robot now; the rate of changes is taken here.

        A refusal is a row of the audit log: the first of its kind on this socket.
        """
        self.check(action, robot)
        if permission(action).mutates:
            try:
                self.services.rates.take("robot", robot)
            except TooManyRequestsError:
                self._note_refusal(action, robot)
                raise
            self.services.audit.check_room()

    def check(self, action: str, robot: str) -> None:
        """Return when its role and scope allow that on that robot, which is there: before preparing an action."""
        row = permission(action)
        if not self.names.covers(robot):
            raise UnknownRobotError.of(robot)
        if not row.granted(self.principal):
            self._note_refusal(action, robot)
            if self.principal.kind == "anonymous":
                raise SignInError(f"{action} needs somebody who has signed in: a key or ticket, as ?token= or Bearer")
            raise ForbiddenError(f"{action} needs the role {row.least.word} or more")
        self.services.registry.get(robot)

    # -- reading ---------------------------------------------------------------------------------------------------

    def robots(self) -> list[RobotRecord]:
        """The robots that it sees, by id."""
        return [record for record in self.services.registry.all() if self.names.covers(record.robot.id)]

    def topics(self) -> list[Topic]:
        """Every announced topic that it sees; one of two types is in the list twice."""
        self._require_look("telemetry.read")
        return [
            Topic(self.names.shown(record.robot.id, state.channel.topic), state.channel)
            for record in self.robots()
            for state in record.topics()
        ]

    def find_topic(self, name: str) -> tuple[ResolvedName, Channel | None]:
        """What a topic's name means: the robot's announced one where there is one, or else the likeliest name.

        Raises:
            UnknownRobotError: the name is no robot's that it sees.
        """
        candidates = self.candidates(name)
        for resolved in candidates:
            record = self.services.registry.find(resolved.robot)
            channel = record.channel_of(resolved.name) if record is not None else None
            if channel is not None:
                return resolved, channel
        return candidates[0], None

    def graphs(self) -> list[RobotGraph]:
        """The graphs of the robots that it sees, as far as they were told; names in them are the robots' own."""
        self._require_look("robots.read")
        return [self.services.graphs.of(record.robot.id) for record in self.robots()]

    def find_service(self, name: str) -> ResolvedName:
        """What a service's name means: one that the robot's graph has, or else the likeliest name."""
        candidates = self.candidates(name)
        return next(
            (item for item in candidates if item.name in self.services.graphs.of(item.robot).services), candidates[0]
        )

    def find_action(self, name: str) -> ResolvedName:
        """What an action's name means, likewise."""
        candidates = self.candidates(name)
        return next(
            (item for item in candidates if item.name in self.services.graphs.of(item.robot).actions), candidates[0]
        )

    def candidates(self, name: str) -> list[ResolvedName]:
        """What a name may mean, of robots that once connected; never empty (UnknownRobotError)."""
        known = self.services.registry.find
        found = [ResolvedName(robot, full) for robot, full in self.names.candidates(name) if known(robot) is not None]
        if not found:
            raise UnknownRobotError.of(self.names.robot or name.lstrip("/").partition("/")[0])
        return found

    # -- publishing ------------------------------------------------------------------------------------------------

    async def advertise(self, name: str, *, type_name: str = "") -> Publication:
        """It will publish on that topic; told again, nothing happens. InvalidRequestError: no type is known."""
        resolved, channel = self.find_topic(name)
        known = self._publications.get(resolved)
        if known is not None:
            known.type_name = type_name or known.type_name
            return known
        self.require("robots.publish", resolved.robot)
        if not type_name and channel is None:
            raise InvalidRequestError(f"type is missing, and robot {resolved.robot} announces no topic {resolved.name}")
        if len(self._publications) >= LIMITS.subscriptions_per_viewer:
            raise TooManyError(f"a client publishes on at most {LIMITS.subscriptions_per_viewer} topics")
        publication = self._publications[resolved] = Publication(resolved, type_name)
        await self.record("robots.publish", f"{resolved.robot} {resolved.name} begins")
        return publication

    async def publish(
        self,
        name: str,
        *,
        type_name: str = "",
        message: Any = None,
        cdr: bytes | None = None,
        lease_id: str = "",
        sent_ns: int = 0,
    ) -> None:
        """Publish once; `cdr` wins over `message`. Returns after the robot's agent has taken it.

        An actuator topic needs `lease_id`; there `sent_ns` (wall clock, 0 = now) must be fresh.
        """
        publication = self._publications.get(self.find_topic(name)[0])
        if publication is None:
            publication = await self.advertise(name, type_name=type_name)
        else:
            self.require("robots.publish", publication.resolved.robot)
        resolved = publication.resolved
        publication.sent += 1  # also when the socket ends before the robot has answered: it may be on its way
        try:
            await self.services.fleet.publish(
                resolved.robot,
                resolved.name,
                type_name=type_name or publication.type_name,
                message=message,
                cdr=cdr,
                lease_id=lease_id,
                sent_ns=sent_ns,
                turn=self._turn,
            )
        except MetarosError:
            publication.sent -= 1
            publication.refused += 1
            raise

    def unadvertise(self, name: str) -> None:
        """It publishes there no more; nothing happens when it did not."""
        publication = self._publications.pop(self.find_topic(name)[0], None)
        if publication is not None:
            self._end(publication)

    def close(self) -> None:
        """Its socket is over."""
        publications, self._publications = list(self._publications.values()), {}
        for publication in publications:
            self._end(publication)

    # -- services, actions, parameters -----------------------------------------------------------------------------

    async def call(
        self,
        name: str,
        *,
        type_name: str = "",
        request: Any = None,
        cdr: bytes | None = None,
        raw: bool = False,
        timeout_s: float = LIMITS.command_timeout_s,
        lease_id: str = "",
    ) -> Any:
        """Call a robot's service; its response as JSON-able values, or its CDR where `raw`. `cdr` wins over `request`.

        Without `type_name` the robot's graph says it (UnknownServiceError).
        """
        resolved = self.find_service(name)
        self.require("robots.call", resolved.robot)
        asked: dict[str, Any] = {"service": resolved.name, "type": type_name}
        asked |= {"request": request} if request is not None or cdr is None else {"cdr_bytes": len(cdr)}
        order = NewCommand(robot=resolved.robot, kind="call_service", request=asked, timeout_s=timeout_s)
        await self.record("robots.call", f"{resolved.robot} {resolved.name}")
        with self.services.command_manager.track(order, self.principal) as noted:
            answer = await self.services.fleet.call(
                resolved.robot,
                resolved.name,
                type_name=type_name,
                request={} if request is None else request,
                cdr=cdr,
                raw=raw,
                timeout_s=timeout_s,
                lease_id=lease_id,
                turn=self._turn,
            )
            noted.result = None if raw else answer
        return answer

    async def send_goal(
        self,
        name: str,
        *,
        type_name: str = "",
        goal: Any = None,
        cdr: bytes | None = None,
        timeout_s: float = LIMITS.command_timeout_s,
        lease_id: str = "",
    ) -> Goal:
        """Start a goal of a robot's action; `cdr` (of X_Goal) wins over `goal`. It goes on when the client leaves."""
        resolved = self.find_action(name)
        self.require("robots.call", resolved.robot)
        await self.record("robots.call", f"{resolved.robot} {resolved.name} goal")
        return await self.services.goals.send(
            resolved.robot,
            resolved.name,
            type_name=type_name,
            goal=goal,
            cdr=cdr,
            timeout_s=timeout_s,
            lease_id=lease_id,
            by=self.principal.name or self.principal.id,
        )

    async def cancel_goal(self, robot: str, goal_id: str) -> bool:
        """Ask a robot to stop a goal; whether it will."""
        self.require("robots.call", robot)
        await self.record("robots.call", f"{robot} cancel {goal_id}")
        return await self.services.goals.cancel(robot, goal_id)

    async def offer_service(self, name: str, type_name: str, answer: Answer, *, dialect: Dialect = JSON) -> Offer:
        """Serve a service in a robot's graph until the offer is closed; OfferRefusedError."""
        resolved = self.candidates(name)[0]
        self.require("robots.publish", resolved.robot)
        await self.record("robots.publish", f"{resolved.robot} {resolved.name} offers a service")
        return await self.services.offers.service(resolved.robot, resolved.name, type_name, answer, dialect=dialect)

    async def offer_action(self, name: str, type_name: str, execute: Execute, *, dialect: Dialect = JSON) -> Offer:
        """Serve an action in a robot's graph until the offer is closed; OfferRefusedError."""
        resolved = self.candidates(name)[0]
        self.require("robots.publish", resolved.robot)
        await self.record("robots.publish", f"{resolved.robot} {resolved.name} offers an action")
        return await self.services.offers.action(resolved.robot, resolved.name, type_name, execute, dialect=dialect)

    async def parameters(self, node: str) -> list[Parameter]:
        """The parameters of a robot's node, by name."""
        resolved = self.candidates(node)[0]
        self.require("nodes.read", resolved.robot)
        return await self.services.nodes.values.parameters(resolved.robot, resolved.name)

    async def set_parameters(self, node: str, values: Mapping[str, Any]) -> Sequence[SetResult]:
        """Set parameters of a robot's node, each for itself; they are forgotten with the node's process."""
        resolved = self.candidates(node)[0]
        self.require("nodes.control", resolved.robot)
        await self.record("nodes.control", f"{resolved.robot} {resolved.name}: {', '.join(values)}")
        code = permission("nodes.code").granted(self.principal)
        editor = Editor(name=self.principal.name or self.principal.id, reason="", code=code, confirm_within_s=None)
        actor = Actor(editor=editor, principal=self.principal)
        results, _ = await self.services.nodes.values.set_parameters(
            resolved.robot, resolved.name, values, actor, keep=False, dry_run=False
        )
        return results

    # -- parts -----------------------------------------------------------------------------------------------------

    def _require_look(self, action: str) -> None:
        if not self.may(action):
            raise ForbiddenError(f"{action} needs the role {permission(action).least.word} or more")

    def _end(self, publication: Publication) -> None:
        resolved = publication.resolved
        detail = f"{resolved.robot} {resolved.name} ends: {publication.sent} sent, {publication.refused} refused"
        self.services.audit.add(**self._facts("robots.publish", 200, "", detail))

    async def record(self, action: str, detail: str) -> None:
        """A row of the audit log about what it does; returns when that is committed."""
        await self.services.audit.record(**self._facts(action, 200, "", detail))

    def _note_refusal(self, action: str, robot: str) -> None:
        if (action, robot) not in self._refused and len(self._refused) < LIMITS.subscriptions_per_viewer:
            self._refused.add((action, robot))
            self.services.audit.refuse(**self._facts(action, 403, "forbidden", robot))

    def _facts(self, action: str, status: int, code: str, detail: str) -> dict[str, Any]:
        who = self.principal
        return {
            "kind": who.kind,
            "actor": who.id,
            "name": who.name,
            "role": who.role.word,
            "address": self.address,
            "action": action,
            "method": "SOCKET",
            "target": self.target,
            "status": status,
            "code": code,
            "detail": detail,
        }
