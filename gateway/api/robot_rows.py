"""Robots as rows of a list: rendered once for everybody who asks, until they change.

A row of a robot that is offline holds until something is known anew. What a link brings changes all the time: of one
that is online it is at most ROW_S old; that it is, who drives and which labels it has, never. All methods on the event
loop.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from hashlib import blake2b
from typing import Any

import orjson
from starlette.requests import HTTPConnection

from gateway.api.listing import Fields
from gateway.api.services import Services
from gateway.domain.lease import Lease
from gateway.domain.selector import Selector
from gateway.ingest.registry import Registry, RobotRecord
from metaros.clock import Clock
from metaros.limits import LIMITS

__all__ = ["RobotQuery", "RobotRows", "make_robot_rows", "robot_rows_of"]

ROW_S = 1.0
SELECTIONS = 16  # of fields, whose rows are kept
LOOKED_AT_ONCE = 500  # robots that a filter looks at before it lets others do something
OVERHEAD_BYTES = 500  # of a row beside its text


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotQuery:
    """Which robots of those in scope a list is to have."""

    sees: Callable[[str], bool] | None = None
    selector: Selector | None = None
    online: bool | None = None
    text: str = ""

    @property
    def plain(self) -> bool:
        """Whether every robot is wanted."""
        return self.sees is None and self.selector is None and self.online is None and not self.text

    def matches(self, record: RobotRecord, labels: Callable[[str], Mapping[str, str]]) -> bool:
        """Whether a robot is one of them. The text may be part of its id, host name, or a label's value."""
        robot = record.robot.id
        if self.sees is not None and not self.sees(robot):
            return False
        if self.online is not None and record.online != self.online:
            return False
        if self.selector is not None and not self.selector.matches(robot, labels(robot)):
            return False
        if not self.text:
            return True
        return any(self.text in part.lower() for part in (robot, record.robot.hostname, *labels(robot).values()))


@dataclass(slots=True)
class _Row:
    """A rendered robot, what it was made of, and what its text is known by."""

    text: bytes
    digest: bytes
    revision: int
    desired: object
    lease: Lease | None
    session: tuple[bool, int, int]
    made_s: float


@dataclass(slots=True)
class _Selection:
    """The rows of one selection of fields, by robot."""

    rows: dict[str, _Row] = field(default_factory=dict)
    size_bytes: int = 0


class RobotRows:
    """Pages of robots, by id."""

    def __init__(
        self,
        registry: Registry,
        describe: Callable[[str], Mapping[str, Any]],
        labels: Callable[[str], Mapping[str, str]],
        desired: Callable[[str], object],
        lease: Callable[[str], Lease | None],
        *,
        clock: Clock,
    ) -> None:
        """`describe` is a robot's whole document, `desired` an object that is another one when its labels change."""
        self._registry = registry
        self._describe = describe
        self._labels = labels
        self._desired = desired
        self._lease = lease
        self._clock = clock
        self._selections: dict[str, _Selection] = {}
        self._size_bytes = 0

    async def page(self, query: RobotQuery, *, after: str, limit: int, fields: Fields, text: str) -> tuple[bytes, str]:
        """The page behind a robot's id, as JSON, and its ETag; `text` is how `fields` were asked for."""
        records = await self._chosen(query, after, limit + 1)
        following = records[limit - 1].robot.id if len(records) > limit else None
        del records[limit:]
        rows = self._rows(records, fields, text)
        tag = blake2b(b"".join([row.digest for row in rows]), digest_size=12)
        tag.update(orjson.dumps(following))
        body = b'{"robots":[%b],"next":%b}' % (b",".join([row.text for row in rows]), orjson.dumps(following))
        return body, f'"{tag.hexdigest()}"'

    async def _chosen(self, query: RobotQuery, after: str, most: int) -> list[RobotRecord]:
        if query.plain:
            return self._registry.behind(after, most)
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

    def _rows(self, records: list[RobotRecord], fields: Fields, text: str) -> list[_Row]:
        """This loop is what a large fleet's pages are: where rows are known it does nothing but compare."""
        selection = self._selection(text)
        known, desired_of, lease_of = selection.rows, self._desired, self._lease
        now_s = self._clock.monotonic_s()
        rows = []
        for record in records:
            robot = record.robot.id
            row, desired, lease = known.get(robot), desired_of(robot), lease_of(robot)
            if (  # most of a fleet: it is away, and nothing is new
                row is not None
                and row.revision == record.revision
                and not record.online
                and row.desired is desired
                and row.lease is lease
            ):
                rows.append(row)
                continue
            if row is None or not _holds(row, record, desired, lease, now_s):
                row = self._render(record, desired, lease, fields, now_s)
                self._keep(selection, robot, row)
            rows.append(row)
        return rows

    def _render(self, record: RobotRecord, desired: object, lease: Lease | None, fields: Fields, now_s: float) -> _Row:
        document = fields.of(self._describe(record.robot.id))
        body = orjson.dumps(document, option=orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_NON_STR_KEYS)
        digest = blake2b(body, digest_size=12).digest()
        return _Row(body, digest, record.revision, desired, lease, _session(record), now_s)

    def _selection(self, text: str) -> _Selection:
        """The one that was asked for last is the last to go."""
        selection = self._selections.pop(text, None) or _Selection()
        if len(self._selections) >= SELECTIONS:
            self._forget_oldest()
        self._selections[text] = selection
        return selection

    def _keep(self, selection: _Selection, robot: str, row: _Row) -> None:
        before = selection.rows.pop(robot, None)
        grown = len(row.text) + OVERHEAD_BYTES
        grown -= len(before.text) + OVERHEAD_BYTES if before is not None else 0
        selection.rows[robot] = row
        selection.size_bytes += grown
        self._size_bytes += grown
        while self._size_bytes > LIMITS.robot_rows_bytes and len(self._selections) > 1:
            self._forget_oldest()
        while self._size_bytes > LIMITS.robot_rows_bytes and len(selection.rows) > 1:
            gone = selection.rows.pop(next(iter(selection.rows)))
            selection.size_bytes -= len(gone.text) + OVERHEAD_BYTES
            self._size_bytes -= len(gone.text) + OVERHEAD_BYTES

    def _forget_oldest(self) -> None:
        self._size_bytes -= self._selections.pop(next(iter(self._selections))).size_bytes


def _holds(row: _Row, record: RobotRecord, desired: object, lease: Lease | None, now_s: float) -> bool:
    if row.desired is not desired or (row.lease is not lease and _other(row.lease, lease)):
        return False
    if record.online:
        return now_s - row.made_s < ROW_S and row.session == _session(record)
    return row.revision == record.revision


def _other(before: Lease | None, after: Lease | None) -> bool:
    """A lease that was renewed is another object."""
    return before is None or after is None or before.lease_id != after.lease_id


def _session(record: RobotRecord) -> tuple[bool, int, int]:
    return record.online, record.session_number, len(record.channels)


def make_robot_rows(services: Services) -> RobotRows:
    """The rows of a gateway's robots."""
    twins, clock = services.twins, services.clock
    desired, lease = twins.book.desired.get, services.leases.find
    return RobotRows(services.registry, services.describe, twins.labels_of, desired, lease, clock=clock)


def robot_rows_of(connection: HTTPConnection) -> RobotRows:
    """The rows of the application a request belongs to."""
    rows: RobotRows = connection.app.state.robot_rows
    return rows
