"""The backend of rollouts: reads and edits robots by the twin manager; remote robots by what their gateways stored."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Collection, Iterable
from typing import Any

from gateway.domain.fleet.selector import Selector
from gateway.domain.fleet.twin import Reported
from gateway.fleet.presence import Presence
from gateway.fleet.twins.cache import reported_values
from gateway.fleet.twins.feature import Twins
from gateway.fleet.twins.manager import Editor
from gateway.fleet.twins.plan import Edit, labels_of
from gateway.store import Store
from gateway.store.engine import StoreEngine
from gateway.store.fleet.twins import read_labels, read_reports

__all__ = ["TwinBackend"]

LOST = ("reverted", "refused")


class TwinBackend:
    """A `FleetBackend`: versions are put into robots' own documents, which lie over every template."""

    def __init__(
        self,
        store: Store,
        twins: Twins,
        where: Presence,
        robots: Callable[[], Iterable[str]],
        available: Callable[[str, str, str], Awaitable[bool]],
    ) -> None:
        """`robots`: those that this gateway knows; `available`: whether robots can fetch that version of a bundle."""
        self._store = store
        self._twins = twins
        self._where = where
        self._robots = robots
        self._available = available
        self._remote: dict[str, Reported] = {}

    async def named(self, selector: str) -> list[str]:
        """The robots that a selector names, of all that ever connected to a gateway of the store."""
        wanted = Selector.parse(selector)

        def job(engine: StoreEngine) -> dict[str, dict[str, str]]:
            with engine.transaction(write=False):
                return read_labels(engine)

        said, desired = await self._store.read(job), self._twins.cache.desired
        labels = {robot: labels_of(own, desired.get(robot)) for robot, own in said.items()}
        labels |= {robot: self._twins.labels_of(robot) for robot in self._robots() if self._where.is_here(robot)}
        return [robot for robot, own in labels.items() if wanted.matches(robot, own)]

    async def look(self, robots: Collection[str]) -> None:
        """Learn where robots are, and what those of `robots` reported that are at another gateway."""
        await self._where.look()
        remote = [robot for robot in robots if not self._where.is_here(robot)] if self._store.shared else []

        def job(engine: StoreEngine) -> dict[str, Reported]:
            with engine.transaction(write=False):
                return read_reports(engine, remote)

        self._remote = await self._store.read(job) if remote else {}

    def presence(self, robot: str) -> tuple[bool, int]:
        """Whether the robot is online, and since when it is or is not."""
        return self._where.of(robot)

    def reported(self, robot: str) -> dict[str, Any] | None:
        """What the robot said last of itself."""
        remote = self._remote_report(robot)
        return reported_values(remote) if remote is not None else self._twins.manager.reported_of(robot)

    def refusal(self, robot: str) -> str:
        """Why the robot does not live by the revision that is desired now."""
        said = self._remote_report(robot) or self._twins.cache.reported.get(robot)
        desired = self._twins.manager.desired_of(robot)
        if said is None or desired is None or said.revision != desired.revision or said.state not in LOST:
            return ""
        return f"its twin was {said.state}: {said.message or said.code}"[:300].rstrip(": ")

    def _remote_report(self, robot: str) -> Reported | None:
        """What another gateway stored of the robot, unless this one heard of it later."""
        remote, here = self._remote.get(robot), self._twins.cache.reported.get(robot)
        return remote if remote is not None and (here is None or remote.at_ns > here.at_ns) else None

    async def set_path(self, robot: str, path: str, value: str, *, author: str) -> None:
        """Put a value into the robot's own twin."""
        patch: Any = value
        for key in reversed(path.split(".")):
            patch = {key: patch}
        await self._twins.manager.edit(robot, Edit(patch=patch), Editor(name=author, code=True), dry_run=False)

    async def available(self, kind: str, name: str, version: str) -> bool:
        """Whether robots can fetch that version."""
        return await self._available(kind, name, version)
