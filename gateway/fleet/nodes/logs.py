"""Logs of robots' nodes: pages, live tails, and crash reports.

The lines are the robot's, and the robot is not to be believed in anything: what has not the right shape is left out.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import AsyncGenerator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import orjson

from gateway.errors import CommandRefusedError, InvalidRequestError, TooManyError
from gateway.fleet.command_dispatcher import CommandDispatcher
from gateway.fleet.nodes.manager import NodeManager
from gateway.fleet.robots import FindRobot, require_online
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["LogPage", "NodeLogs"]

QUERY_CHARS = 256
PAUSE_S = (0.5, 2.0)  # between two looks for new lines: longer while nothing comes
FIRST_BYTES = 16 * 1024  # of the lines that a tail begins with


@dataclass(frozen=True, slots=True)
class LogPage:
    """Lines (time in ns, text), oldest first, and the cursor to go on with in the same direction."""

    lines: tuple[tuple[int, str], ...]
    cursor: str
    more: bool


class NodeLogs:
    """All methods on the event loop."""

    def __init__(
        self,
        manager: NodeManager,
        find: FindRobot,
        commands: CommandDispatcher,
        *,
        clock: Clock,
        limits: Limits = LIMITS,
    ) -> None:
        self._manager = manager
        self._find = find
        self._commands = commands
        self._clock = clock
        self._limits = limits
        self._tails: Counter[tuple[str, str]] = Counter()  # by ("robot", id) and ("who", whoever follows)

    async def page(
        self,
        robot: str,
        node: str,
        *,
        cursor: str = "",
        query: str = "",
        backwards: bool = False,
        max_bytes: int = LIMITS.node_log_page_bytes,
    ) -> LogPage:
        """One page of a node's log.

        Raises:
            InvalidRequestError: no such cursor, or too long a query.
            UnknownRobotError, UnknownNodeError: there is no such thing.
            RobotError: the robot is not there, or has no log of it.
        """
        _check(cursor, query)
        await self._require(robot, node)
        return await self._read(robot, node, cursor, query, backwards=backwards, max_bytes=max_bytes)

    async def crashes(self, robot: str, node: str) -> list[dict[str, Any]]:
        """How the node ended the last times, the newest first: at_ns, reason, pid, ran_s, version, argv, env, lines."""
        await self._require(robot, node)
        verb = link_pb2.Command(node_verb=link_pb2.NodeVerb(node=node, verb="crashes"))
        result = await self._commands.run(robot, verb, timeout_s=self._limits.command_timeout_s, look=True)
        found = _object(result.payload).get("crashes")
        return [item for item in reversed(found) if isinstance(item, dict)] if isinstance(found, list) else []

    async def tail(
        self, robot: str, node: str, *, who: str, cursor: str = "", query: str = ""
    ) -> AsyncGenerator[LogPage, None]:
        """Pages as they come, for a while; one without lines says that nothing came. Begins with the newest lines,
        or after the cursor. Errors as those of `page`, before anything is given out.

        Raises:
            TooManyError: `who`, or all together, follow too many logs already.
        """
        _check(cursor, query)
        await self._require(robot, node)
        self._room(robot, who)
        return self._follow(robot, node, who, cursor, query)

    async def _follow(self, robot: str, node: str, who: str, cursor: str, query: str) -> AsyncGenerator[LogPage, None]:
        until_s = self._clock.monotonic_s() + self._limits.node_tail_s
        pause_s, size = PAUSE_S[0], self._limits.node_log_page_bytes if cursor else FIRST_BYTES
        with self._place(robot, who):
            while self._clock.monotonic_s() < until_s:
                page = await self._read(robot, node, cursor, query, backwards=False, max_bytes=size)
                cursor, size = page.cursor, self._limits.node_log_page_bytes
                yield page
                if page.more:
                    continue
                pause_s = PAUSE_S[0] if page.lines else min(1.5 * pause_s, PAUSE_S[1])
                await asyncio.sleep(pause_s)

    def _room(self, robot: str, who: str) -> None:
        limits = self._limits
        everybody = sum(count for (kind, _), count in self._tails.items() if kind == "who")
        for said, count, most in (
            ("are followed at this gateway", everybody, limits.node_tails),
            (f"of robot {robot} are followed", self._tails["robot", robot], limits.node_tails_of_robot),
            ("are followed by the same one", self._tails["who", who], limits.node_tails_of_one),
        ):
            if count >= most:
                raise TooManyError(f"{count} logs {said} already: at most {most} at a time")

    @contextmanager
    def _place(self, robot: str, who: str) -> Iterator[None]:
        self._room(robot, who)
        taken = [("robot", robot), ("who", who)]
        self._tails.update(taken)
        try:
            yield
        finally:
            self._tails.subtract(taken)
            self._tails += Counter()  # without those that are none any more

    async def _require(self, robot: str, node: str) -> None:
        (await self._manager.of_robot(robot)).get(node)
        require_online(self._find(robot))

    async def _read(
        self, robot: str, node: str, cursor: str, query: str, *, backwards: bool, max_bytes: int
    ) -> LogPage:
        asked = link_pb2.ReadLog(node=node, cursor=cursor, query=query, backwards=backwards, max_bytes=max_bytes)
        command = link_pb2.Command(read_log=asked)
        result = await self._commands.run(robot, command, timeout_s=self._limits.command_timeout_s, look=True)
        found = _object(result.payload)
        lines, said = found.get("lines"), str(found.get("cursor", ""))
        return LogPage(
            tuple(_lines(lines if isinstance(lines, list) else [])),
            said if _is_cursor(said) else cursor,
            found.get("more") is True,
        )


def _lines(found: list[Any]) -> Iterator[tuple[int, str]]:
    for line in found:
        if isinstance(line, dict) and type(line.get("at_ns")) is int and isinstance(line.get("text"), str):
            yield line["at_ns"], line["text"]


def _check(cursor: str, query: str) -> None:
    if cursor and not _is_cursor(cursor):
        raise InvalidRequestError("cursor: not one that a log has given")
    if len(query) > QUERY_CHARS:
        raise InvalidRequestError(f"query: at most {QUERY_CHARS} characters")


def _is_cursor(text: str) -> bool:
    return text.isascii() and text.isdigit() and len(text) <= 20


def _object(payload: bytes) -> dict[str, Any]:
    """What a robot answered; CommandRefusedError where that is no JSON object."""
    try:
        found = orjson.loads(payload)
    except orjson.JSONDecodeError:
        found = None
    if not isinstance(found, dict):
        raise CommandRefusedError("the robot's answer is no JSON object", agent_code="peer")
    return found
