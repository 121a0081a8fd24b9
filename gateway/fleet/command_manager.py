"""Stored commands: answered within the request, or durable and delivered when the robot comes online."""

from __future__ import annotations

import asyncio
import hashlib
import logging
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import orjson

from gateway.domain.errors import CommandDeliveredError, UnknownCommandError
from gateway.domain.fleet.command import (
    CANCELLED,
    DONE,
    FAILED,
    ISSUED,
    Command,
    is_command_id,
    new_command_id,
    wire_id,
)
from gateway.domain.idempotency import check_key
from gateway.domain.principal import Principal
from gateway.errors import (
    BodyTooLargeError,
    CommandRefusedError,
    InvalidRequestError,
    RequestError,
    RobotError,
    StoreError,
    UnknownRobotError,
)
from gateway.fleet.command_dispatcher import CommandDispatcher
from gateway.fleet.command_rows import CommandRows, Database
from gateway.fleet.command_watchers import CommandWatchers
from gateway.fleet.delivery import Delivery
from gateway.fleet.kinds import build, kind_of, read_result
from gateway.fleet.manager import MAX_TIMEOUT_S, FleetManager
from gateway.fleet.robots import FindRobot, SendFrame
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["CommandManager", "NewCommand", "TrackedCommand"]

log = logging.getLogger(__name__)

NOTES = 4096  # tracked commands that wait for the store; further ones leave no row
NOTE_S = 0.2
NOTE_RETRY_S = 1.0  # while the store takes none
UNSHOWN = frozenset({"lease_id"})  # whoever reads the history would have the robot: the id is all that a lease asks for
Local = Callable[[str, Mapping[str, Any]], Awaitable[Any]]  # robot and request; what it answers, as JSON


@dataclass(frozen=True, slots=True, kw_only=True)
class NewCommand:
    """A command that a client requests of a robot."""

    robot: str
    kind: str
    request: Mapping[str, Any]
    durable: bool = False
    expires_s: float = LIMITS.command_expires_s
    timeout_s: float = LIMITS.command_timeout_s
    idempotency: str | None = None
    sent_ns: int = 0  # when its client made it; 0 = now

    @property
    def digest(self) -> str:
        """By which the same request is known again."""
        asked = [self.robot, self.kind, dict(self.request), self.durable, self.timeout_s]
        asked += [self.expires_s] if self.durable else []
        return hashlib.sha256(orjson.dumps(asked, option=orjson.OPT_SORT_KEYS)).hexdigest()


@dataclass(slots=True)
class TrackedCommand:
    """A command of an endpoint without durable commands while it runs; `result` is its answer, as JSON."""

    result: Any = None


class CommandManager:
    """Everything about commands that are kept; all methods on the event loop."""

    def __init__(
        self,
        database: Database,
        commands: CommandDispatcher,
        fleet: FleetManager,
        find: FindRobot,
        send: SendFrame,
        *,
        clock: Clock,
        local: Mapping[str, Local] | None = None,
        ended: Callable[[Command], None] | None = None,
        limits: Limits = LIMITS,
    ) -> None:
        """`local` are kinds that another feature of this gateway carries out, and keeps until the robot comes.

        `ended` hears of every command that comes to its end here.
        """
        self._local = dict(local or {})
        self._rows = CommandRows(database, ended=ended)
        self._commands = commands
        self._fleet = fleet
        self._find = find
        self._clock = clock
        self._limits = limits
        self._watchers = CommandWatchers(self._rows)
        self._notes: deque[Command] = deque(maxlen=NOTES)
        self._noted = asyncio.Event()
        self.waiting: Callable[[str], None] = lambda robot: None  # a robot that is not linked here has another one
        self.moved: Callable[[str], None] = lambda command_id: None  # one has another state
        self.delivery = Delivery(
            self._rows,
            send,
            online=self._online,
            read=lambda wire, payload: read_result(fleet, wire, payload),
            changed=self._changed,
            clock=clock,
            limits=limits,
        )

    async def send(self, order: NewCommand, principal: Principal) -> Command:
        """Store a command and have it carried out: an immediate one is over when this returns, a durable one is not.

        The same order under the same idempotency key is the same command, however often it is sent.

        Raises:
            InvalidRequestError, UnknownRobotError, LeaseRequiredError: it cannot be.
            IdempotencyConflictError: the key was used for another request.
            TooManyError: the robot has too many durable commands that are not over.
            StoreError: it cannot be stored now, and was not sent.
        """
        self._check(order)
        self._find(order.robot)
        command = self._made(order, principal)
        if order.idempotency is not None and (known := await self._rows.same(command)) is not None:
            return known  # the lease that it needed then need not hold any more
        wire = await build(self._fleet, order.robot, kind_of(order.kind), order.request, durable=order.durable)
        if order.durable:
            command = replace(command, wire=wire.SerializeToString())
            if len(command.wire) > self._limits.command_request_bytes:
                raise BodyTooLargeError(f"a durable command has at most {self._limits.command_request_bytes} bytes")
        stored = await self._rows.add(command, most_open=self._limits.durable_kept)
        if stored.id != command.id:
            return stored
        if order.durable:
            self.delivery.deliver(order.robot)
            if not self._online(order.robot):
                self.waiting(order.robot)
            return stored
        wire.sent_ns = order.sent_ns
        return await self._carry_out(stored, wire)

    async def get(self, command_id: str) -> Command:
        """One command; UnknownCommandError when there is none."""
        found = await self._rows.get(command_id) if is_command_id(command_id) else None
        if found is None:
            raise UnknownCommandError.of(command_id)
        return found

    async def list(
        self, *, robot: str = "", state: str = "", issuer: str = "", before: str = "", limit: int
    ) -> list[Command]:
        """The newest, newest first."""
        return await self._rows.newest(robot=robot, state=state, issuer=issuer, before=before, limit=limit)

    async def cancel(self, command_id: str) -> Command:
        """Take back a command that has not left; CommandDeliveredError when it has, or is over."""
        command = await self.get(command_id)
        values = {"state": CANCELLED, "ended_ns": self._clock.wall_ns(), "code": "cancelled", "wire": b""}
        durable = command.durable
        if not durable or not await self._rows.change(command_id, within=(ISSUED,), **values):
            command = await self.get(command_id)
            raise CommandDeliveredError(f"command {command_id} is {command.state}: it cannot be taken back")
        self._changed(command_id)
        return await self.get(command_id)

    async def wait(self, command_id: str, wait_s: float) -> Command:
        """The command at its end, or after `wait_s` as it is then."""
        command = await self.get(command_id)
        try:
            async with asyncio.timeout(max(0.0, min(wait_s, self._limits.command_wait_s))):
                async for seen in self.watch(command_id):
                    command = seen
        except TimeoutError:
            pass
        return command

    async def watch(self, command_id: str) -> AsyncIterator[Command]:
        """The command as it is, then at each change, until it is over."""
        seen = ""
        with self._watchers.watching(command_id) as watched:
            while True:
                event = watched.event  # from before the look: no change comes between
                command = await self.get(command_id)
                watched.saw(command.state)
                if command.state != seen:
                    seen = command.state
                    yield command
                if command.over:
                    return
                await event.wait()

    @contextmanager
    def track(self, order: NewCommand, principal: Principal) -> Iterator[TrackedCommand]:
        """Track an immediate command that an endpoint carries out by itself: its end is stored shortly after.

        What never left for the robot (an error of the request) leaves no row.
        """
        track, begun_ns = TrackedCommand(), self._clock.wall_ns()
        end: dict[str, Any] = {"state": DONE}
        try:
            yield track
            if track.result is not None:
                end["result"] = orjson.dumps(track.result, option=orjson.OPT_SERIALIZE_NUMPY).decode()
        except RobotError as error:
            end = _failure(error)
            raise
        except BaseException:
            end = {}
            raise
        finally:
            if end:
                text = end.get("result", "")
                end["result"] = text if len(text) <= self._limits.result_bytes else ""
                self._note(order, principal, begun_ns, end)

    async def run(self) -> None:
        """Deliver and record, until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self.delivery.run())
            group.create_task(self._write_notes())
            group.create_task(self._watchers.run())

    async def close(self) -> None:
        """Write what is noted, if the store takes it, and stop."""
        await self.delivery.close()
        try:
            await self._write_some()
        except StoreError as error:
            log.warning("the last commands are not in the history: %s", error)

    def _online(self, robot: str) -> bool:
        try:
            return self._find(robot).here
        except UnknownRobotError:  # it has only ever been at another gateway of this store
            return False

    def _check(self, order: NewCommand) -> None:
        kind_of(order.kind)
        if not 0 < order.timeout_s <= MAX_TIMEOUT_S:
            raise InvalidRequestError(f"timeout_s is more than 0 and at most {MAX_TIMEOUT_S:g}")
        if order.durable and not 0 < order.expires_s <= self._limits.command_expires_most_s:
            raise InvalidRequestError(f"expires_s is more than 0 and at most {self._limits.command_expires_most_s:g}")
        if order.durable and order.kind in self._local:
            raise InvalidRequestError(f"{order.kind} waits for its robot by itself: leave durable away")
        if order.idempotency is not None:
            check_key(order.idempotency)

    def _made(self, order: NewCommand, principal: Principal) -> Command:
        now_ns = self._clock.wall_ns()
        shown = {key: value for key, value in order.request.items() if key not in UNSHOWN}
        try:
            request = orjson.dumps(shown).decode()
        except orjson.JSONEncodeError as error:  # its reader takes longer numbers than its writer does
            raise InvalidRequestError(f"a command's request is JSON with whole numbers of 64 bits: {error}") from error
        if len(request) > self._limits.command_request_bytes:
            raise BodyTooLargeError(f"a command's request has at most {self._limits.command_request_bytes} bytes")
        return Command(
            id=new_command_id(now_ns),
            robot=order.robot,
            kind=order.kind,
            request=request,
            wire=b"",
            issuer=f"{principal.kind}:{principal.id}",
            issued_by=principal.name or principal.id,
            idempotency=order.idempotency,
            digest=order.digest,
            durable=order.durable,
            timeout_ms=max(1, round(order.timeout_s * 1000)),
            issued_ns=now_ns,
            expires_ns=now_ns + round(order.expires_s * 1e9) if order.durable else 0,
        )

    async def _carry_out(self, command: Command, wire: link_pb2.Command) -> Command:
        """An immediate one: sent, and its end stored."""
        end: dict[str, Any] = {"state": FAILED, "code": "timeout", "message": "the request ended before its robot"}
        delivered_ns = self._clock.wall_ns()
        try:
            end = {"state": DONE, "result": await self._outcome(command, wire)}
        except (RobotError, RequestError) as error:
            end = _failure(error)
        finally:
            values = {"delivered_ns": delivered_ns, "ended_ns": self._clock.wall_ns(), **end}
            await asyncio.shield(asyncio.ensure_future(self._store_end(command.id, values)))
        return replace(command, **values)

    async def _outcome(self, command: Command, wire: link_pb2.Command) -> str:
        """What came back, as JSON; "" for nothing."""
        if (local := self._local.get(command.kind)) is not None:
            return orjson.dumps(await local(command.robot, orjson.loads(command.request))).decode()
        result = await self._commands.run(
            command.robot, wire, timeout_s=command.timeout_ms / 1000, command_id=wire_id(command.id)
        )
        payload = result.payload if len(result.payload) <= self._limits.result_bytes else b""
        return await read_result(self._fleet, wire, payload)

    async def _store_end(self, command_id: str, values: dict[str, Any]) -> None:
        try:
            await self._rows.change(command_id, **values)
        except StoreError as error:  # whoever asked hears how it went; the history will say that nobody knows
            log.warning("the end of command %s is not stored: %s", command_id, error)
        self._changed(command_id)

    def _note(self, order: NewCommand, principal: Principal, begun_ns: int, end: dict[str, Any]) -> None:
        text = orjson.dumps(dict(order.request), option=orjson.OPT_SERIALIZE_NUMPY).decode()
        if len(text) > self._limits.command_request_bytes:
            text = orjson.dumps({"size_bytes": len(text)}).decode()
        self._notes.append(
            Command(
                id=new_command_id(begun_ns),
                robot=order.robot,
                kind=order.kind,
                request=text,
                wire=b"",
                issuer=f"{principal.kind}:{principal.id}",
                issued_by=principal.name or principal.id,
                digest="",
                durable=False,
                timeout_ms=max(1, round(order.timeout_s * 1000)),
                issued_ns=begun_ns,
                delivered_ns=begun_ns,
                ended_ns=self._clock.wall_ns(),
                **end,
            )
        )
        self._noted.set()

    async def _write_notes(self) -> None:
        while True:
            await self._noted.wait()
            self._noted.clear()
            try:
                await self._write_some()
            except StoreError as error:
                log.debug("commands wait for the store: %s", error)
                self._noted.set()
                await asyncio.sleep(NOTE_RETRY_S)
            await asyncio.sleep(NOTE_S)

    async def _write_some(self) -> None:
        while self._notes:
            some = list(self._notes)[:256]
            await self._rows.note(some)
            for _ in some:
                self._notes.popleft()

    def changed(self, command_id: str) -> None:
        """Another gateway says that a command has another state."""
        self._watchers.changed(command_id)

    def _changed(self, command_id: str) -> None:
        self._watchers.changed(command_id)
        self.moved(command_id)


def _failure(error: RobotError | RequestError) -> dict[str, Any]:
    """How it ended, of an error that the robot or its link gave."""
    code = (error.agent_code or error.code) if isinstance(error, CommandRefusedError) else error.code
    return {"state": FAILED, "code": code[:64], "message": str(error)[:500].replace("\0", "")}
