"""Pages of robots as they were sent last, for as long as nothing in them is known to be otherwise; bounded in bytes."""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter

from gateway.api.robot_search import RobotQuery
from gateway.ingest.registry import RobotRecord

__all__ = ["Asked", "Page", "RobotPages", "marks_of", "revisions_of"]

Asked = tuple[RobotQuery, str, int, str]  # which robots, behind which, how many, which fields
_REVISION = attrgetter("revision")


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """A page as JSON with its ETag, and what it was made of: its robots, and the one behind them.

    `given` stands for labels and leases, of all robots; `until_s` is when what robots with a link say is too old.
    """

    body: bytes
    tag: str
    records: list[RobotRecord]
    revisions: list[int]
    marks: list[int]
    given: object
    until_s: float


def revisions_of(records: list[RobotRecord]) -> list[int]:
    """Numbers that are the same as long as nothing at all is new of these robots."""
    return list(map(_REVISION, records))


def marks_of(records: list[RobotRecord]) -> list[int]:
    """The same, but of a link it only counts which it is and how many channels it has: what it brings is always new."""
    return [
        -1 - (record.session_number << 20) - len(record.channels) if record.online else record.revision
        for record in records
    ]


class RobotPages:
    """What was made first is the first to go."""

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._pages: dict[Asked, Page] = {}
        self._size_bytes = 0

    def find(self, asked: Asked, records: list[RobotRecord], given: object, now_s: float) -> Page | None:
        """The page, if it would be the same now. This is what a large fleet's pages are."""
        page = self._pages.get(asked)
        if page is None or now_s >= page.until_s or page.records != records or page.given != given:
            return None
        shown = records[: asked[2]]
        return page if page.revisions == revisions_of(shown) or page.marks == marks_of(shown) else None

    def keep(self, asked: Asked, page: Page) -> None:
        """Another one, in the place of what it was before; a quarter of the room is the most for one."""
        if (before := self._pages.pop(asked, None)) is not None:
            self._size_bytes -= len(before.body)
        if len(page.body) > self._max_bytes // 4:
            return
        self._pages[asked] = page
        self._size_bytes += len(page.body)
        while self._size_bytes > self._max_bytes:
            self._size_bytes -= len(self._pages.pop(next(iter(self._pages))).body)
