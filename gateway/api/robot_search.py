"""Which robots a list is to have, by id. What was found is remembered, by what was asked for and in which scope.

It holds until a robot is new, says other things of itself or is given other labels; who is online changes all the
time, so a search for that is never remembered. All methods on the event loop.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from gateway.domain.fleet.selector import Selector
from gateway.domain.principal import EVERY_ROBOT, in_scope
from gateway.ingest.registry import Registry, RobotRecord

__all__ = ["RobotQuery", "RobotSearch"]

LOOKED_AT_ONCE = 500  # robots that a search looks at before it lets others do something
REMEMBERED = 100_000  # robots on all remembered pages together, a pointer each
PAGE = 10  # what a page counts for beside its robots


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotQuery:
    """Which robots are wanted, of those in a scope: a principal's patterns."""

    scope: tuple[str, ...] = EVERY_ROBOT
    selector: Selector | None = None
    online: bool | None = None
    text: str = ""

    @property
    def plain(self) -> bool:
        """Whether every robot is wanted."""
        return "*" in self.scope and self.selector is None and self.online is None and not self.text

    def matches(self, record: RobotRecord, labels: Callable[[str], Mapping[str, str]]) -> bool:
        """Whether a robot is one of them. The text may be part of its id, host name, or a label's value."""
        robot = record.robot.id
        if self.online is not None and record.online != self.online:
            return False
        if not in_scope(self.scope, robot):
            return False
        if self.selector is not None and not self.selector.matches(robot, labels(robot)):
            return False
        if not self.text:
            return True
        return any(self.text in part.lower() for part in (robot, record.robot.hostname, *labels(robot).values()))


_Asked = tuple[RobotQuery, str, int]


class RobotSearch:
    """Finds pages of robots."""

    def __init__(
        self, registry: Registry, labels: Callable[[str], Mapping[str, str]], given: Callable[[], object]
    ) -> None:
        """`given` is equal to what it was before for as long as nobody gave a robot other labels."""
        self._registry = registry
        self._labels = labels
        self._given = given
        self._state: tuple[int, object] = (-1, None)
        self._found: dict[_Asked, list[RobotRecord]] = {}  # in that state; what was asked for last is the last to go
        self._size = 0

    async def behind(self, query: RobotQuery, after: str, most: int) -> list[RobotRecord]:
        """At most so many robots behind an id, which need not be one. The list is not the caller's to change."""
        if query.plain:
            return self._registry.behind(after, most)
        if query.online is not None:
            return await self._look(query, after, most)
        asked, state = (query, after, most), (self._registry.revision, self._given())
        if state != self._state:
            self._found, self._size, self._state = {}, 0, state
        found = self._found.pop(asked, None)
        if found is None:
            found = await self._look(query, after, most)
            if self._state != state or asked in self._found:
                return found  # of before a change that others have seen meanwhile; or somebody was quicker
            self._size += len(found) + PAGE
        self._found[asked] = found
        while self._size > REMEMBERED:
            self._size -= len(self._found.pop(next(iter(self._found)))) + PAGE
        return found

    async def _look(self, query: RobotQuery, after: str, most: int) -> list[RobotRecord]:
        found: list[RobotRecord] = []
        while some := self._registry.behind(after, LOOKED_AT_ONCE):
            for record in some:
                if query.matches(record, self._labels):
                    found.append(record)
                    if len(found) == most:
                        return found
            after = some[-1].robot.id
            await asyncio.sleep(0)
        return found
