"""What a rollout sees and does of robots, by the twins' desk."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable
from typing import Any

from gateway.domain.selector import Selector
from gateway.fleet.twin_feature import Twins
from gateway.fleet.twin_plan import Edit
from gateway.fleet.twins import Editor

__all__ = ["TwinSide"]

LOST = ("reverted", "refused")


class TwinSide:
    """A `FleetSide`: versions are put into robots' own documents, which lie over every template."""

    def __init__(
        self,
        twins: Twins,
        robots: Callable[[], Iterable[str]],
        presence: Callable[[str], tuple[bool, int]],
        available: Callable[[str, str, str], Awaitable[bool]],
    ) -> None:
        """`robots`: every one that ever connected."""
        self._twins = twins
        self._robots = robots
        self.presence = presence
        self._available = available

    def named(self, selector: str) -> list[str]:
        """The robots that a selector names."""
        wanted = Selector.parse(selector)
        return [robot for robot in self._robots() if wanted.matches(robot, self._twins.labels_of(robot))]

    def reported(self, robot: str) -> dict[str, Any] | None:
        """What the robot said last of itself."""
        return self._twins.desk.reported_of(robot)

    def refusal(self, robot: str) -> str:
        """Why the robot does not live by the revision that is desired now."""
        said, desired = self._twins.book.reported.get(robot), self._twins.desk.desired_of(robot)
        if said is None or desired is None or said.revision != desired.revision or said.state not in LOST:
            return ""
        return f"its twin was {said.state}: {said.message or said.code}"[:300].rstrip(": ")

    async def set_path(self, robot: str, path: str, value: str, *, author: str) -> None:
        """Put a value into the robot's own twin."""
        patch: Any = value
        for key in reversed(path.split(".")):
            patch = {key: patch}
        await self._twins.desk.edit(robot, Edit(patch=patch), Editor(name=author, code=True), dry_run=False)

    async def available(self, kind: str, name: str, version: str) -> bool:
        """Whether robots can fetch that version."""
        return await self._available(kind, name, version)
