"""Pages of robots as they were sent last, for as long as nothing in them is known to be otherwise; bounded in bytes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from gateway.api.robot_search import RobotQuery
from gateway.domain.fleet.lease import Lease
from gateway.ingest.registry import RobotRecord

__all__ = ["Asked", "Page", "PageState", "RobotPages", "state_of"]

Asked = tuple[RobotQuery, str, int, str]  # which robots, behind which, how many, which fields
PageState = tuple[list[int], list[object], list[Lease | None]]


@dataclass(frozen=True, slots=True)
class Page:
    """A page as JSON with its ETag; what it was made of; until when what robots with a link say in it is new enough."""

    body: bytes
    tag: str
    records: list[RobotRecord]
    state: PageState
    until_s: float


def state_of(
    records: list[RobotRecord], desired: Callable[[str], object], lease: Callable[[str], Lease | None]
) -> PageState:
    """What a page of some robots is made of, as numbers and objects that are others when it would be another page."""
    ids = [record.robot.id for record in records]
    # What a link brings changes all the time: of a robot that has one it counts which link that is, and its channels.
    marks = [
        -1 - (record.session_number << 20) - len(record.channels) if record.online else record.revision
        for record in records
    ]
    return marks, list(map(desired, ids)), list(map(lease, ids))


class RobotPages:
    """What was made first is the first to go."""

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._pages: dict[Asked, Page] = {}
        self._size_bytes = 0

    def find(self, asked: Asked, records: list[RobotRecord], state: PageState, now_s: float) -> Page | None:
        """The page, if it would be the same now."""
        page = self._pages.get(asked)
        if page is None or now_s >= page.until_s or page.records != records or page.state != state:
            return None
        return page

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
