"""Robots as rows of a list: rendered once for everybody who asks, until they change. So are whole pages.

A row of a robot that is offline holds until something is known anew. What a link brings changes all the time: of one
that is online it is at most ROW_S old; that it is, who drives and which labels it has, never. All methods on the event
loop.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from hashlib import blake2b
from typing import Any

import orjson
from starlette.requests import HTTPConnection

from gateway.api.listing import Fields
from gateway.api.robot_pages import Page, RobotPages, marks_of, revisions_of
from gateway.api.robot_search import RobotQuery, RobotSearch
from gateway.api.services import Services
from gateway.domain.fleet.lease import Lease
from gateway.ingest.registry import RobotRecord
from metaros.clock import Clock
from metaros.limits import LIMITS

__all__ = ["RobotRows", "make_robot_rows", "robot_rows_of"]

ROW_S = 1.0
SELECTIONS = 16  # of fields, whose rows are kept
RENDERED_AT_ONCE = 200  # rows, before others get to do something
OVERHEAD_BYTES = 500  # of a row beside its text


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
        search: RobotSearch,
        describe: Callable[[str], Mapping[str, Any]],
        desired: Callable[[str], object],
        lease: Callable[[str], Lease | None],
        *,
        given: Callable[[], object],
        clock: Clock,
    ) -> None:
        """`describe` is a robot's whole document, `desired` an object that is another one when its labels change.

        `given` is equal to what it was before for as long as no robot has other labels or somebody else driving it.
        """
        self._search = search
        self._describe = describe
        self._desired = desired
        self._lease = lease
        self._given = given
        self._clock = clock
        self._selections: dict[str, _Selection] = {}
        self._size_bytes = 0
        self._pages = RobotPages(LIMITS.robot_pages_bytes)

    async def page(self, query: RobotQuery, *, after: str, limit: int, fields: Fields, text: str) -> tuple[bytes, str]:
        """The page behind a robot's id, as JSON, and its ETag; `text` is how `fields` were asked for."""
        records = await self._search.behind(query, after, limit + 1)
        asked, given, now_s = (query, after, limit, text), self._given(), self._clock.monotonic_s()
        if (page := self._pages.find(asked, records, given, now_s)) is not None:
            return page.body, page.tag
        shown = records[:limit]
        revisions, marks = revisions_of(shown), marks_of(shown)  # of before it is made
        following = orjson.dumps(shown[-1].robot.id if len(records) > limit else None)
        rows = await self._rows(shown, fields, text)
        tag = blake2b(b"".join([row.digest for row in rows]), digest_size=12)
        tag.update(following)
        body = b'{"robots":[%b],"next":%b}' % (b",".join([row.text for row in rows]), following)
        until_s = min((row.made_s + ROW_S for row in rows if row.session[0]), default=math.inf)
        page = Page(
            body=body,
            tag=f'"{tag.hexdigest()}"',
            records=records,
            revisions=revisions,
            marks=marks,
            given=given,
            until_s=until_s,
        )
        self._pages.keep(asked, page)
        return page.body, page.tag

    async def _rows(self, records: list[RobotRecord], fields: Fields, text: str) -> list[_Row]:
        """This loop is what a large fleet's pages are: where rows are known it does nothing but compare."""
        selection = self._selection(text)
        known, desired_of, lease_of = selection.rows, self._desired, self._lease
        now_s, rendered = self._clock.monotonic_s(), 0
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
                self._keep(text, selection, robot, row)
                rendered += 1
                if rendered % RENDERED_AT_ONCE == 0:
                    await asyncio.sleep(0)
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

    def _keep(self, text: str, selection: _Selection, robot: str, row: _Row) -> None:
        if self._selections.get(text) is not selection:
            return  # it was forgotten while its rows were rendered
        before = selection.rows.pop(robot, None)
        grown = len(row.text) + OVERHEAD_BYTES
        grown -= len(before.text) + OVERHEAD_BYTES if before is not None else 0
        selection.rows[robot] = row
        selection.size_bytes += grown
        self._size_bytes += grown
        while self._size_bytes > LIMITS.robot_rows_bytes and len(self._selections) > 1:
            self._forget_oldest()
        if self._selections.get(text) is not selection:
            return
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
    search = RobotSearch(services.registry, twins.labels_of, lambda: twins.cache.revision)
    leases = services.leases
    return RobotRows(
        search,
        services.describe,
        twins.cache.desired.get,
        leases.find,
        given=lambda: (twins.cache.revision, leases.revision),
        clock=clock,
    )


def robot_rows_of(connection: HTTPConnection) -> RobotRows:
    """The rows of the application a request belongs to."""
    rows: RobotRows = connection.app.state.robot_rows
    return rows
