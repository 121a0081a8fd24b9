"""In-memory cache of twins: desired and reported states, templates."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

import orjson

from gateway.domain.fleet.twin import Desired, Reported, Template
from gateway.store import Store
from gateway.store.engine import StoreEngine
from gateway.store.fleet.templates import read_templates
from gateway.store.fleet.twins import changed_twins, newest_change, read_reports, write_reports
from metaros._proto import link_pb2
from metaros.limits import LIMITS

__all__ = ["TwinCache", "reported_values"]

log = logging.getLogger(__name__)

TEXT_CHARS = 1024
STATES = ("applied", "applying", "confirming", "reverted", "refused")
SAVED_AT_ONCE = 256
LOADED_BYTES = 16 * 1024  # longer values of earlier days stay in the database until somebody asks

Listener = Callable[[str, dict[str, Any]], None]
Watcher = Callable[[Reported | None, Reported], None]  # what a robot reported before (None: nothing), and now


class TwinCache:
    """All methods on the event loop."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self.desired: dict[str, Desired] = {}
        self.revision = 0  # grows with every change of `desired`
        self.reported: dict[str, Reported] = {}
        self.templates: dict[str, Template] = {}
        self._change = 0
        self.templates_change = -1  # the change that `templates` is the outcome of
        self._unsaved: dict[str, Reported] = {}
        self._values: dict[str, bytes] = {}  # of `reported`, the oldest first
        self._values_bytes = self._unsaved_bytes = 0
        self._listeners: list[Listener] = []
        self._watchers: list[Watcher] = []

    def listen(self, listener: Listener) -> None:
        """Call this with each robot's `reported` values as they come."""
        self._listeners.append(listener)

    def watch(self, watcher: Watcher) -> None:
        """Call this with each report and the one before it; its `reported` is empty where it is not held."""
        self._watchers.append(watcher)

    async def load(self) -> None:
        """Know what was stored before this gateway began."""
        await self.refresh()

        def job(engine: StoreEngine) -> dict[str, Reported]:
            with engine.transaction(write=False):
                return read_reports(engine, values_bytes=LOADED_BYTES)

        for robot, item in (await self._store.read(job)).items():
            if robot not in self.reported:
                self._remember(item)

    async def refresh(self) -> list[str]:
        """Learn what changed; the robots whose desired state did. StoreError when the database cannot be asked."""

        def job(engine: StoreEngine) -> tuple[int, int, list[Desired], dict[str, Template] | None]:
            with engine.transaction(write=False):
                change, templates = newest_change(engine)
                changed = changed_twins(engine, self._change) if change > self._change else []
                return (
                    change,
                    templates,
                    changed,
                    read_templates(engine) if templates > self.templates_change else None,
                )

        change, templates_change, changed, templates = await self._store.read(job)
        if templates is not None and templates_change > self.templates_change:
            self.templates, self.templates_change = templates, templates_change
        learnt = self.learn(changed)
        self._change = max(self._change, change)
        return learnt

    def learn(self, items: Iterable[Desired]) -> list[str]:
        """Take over states that were read or stored; the robots for which they are newer than what was known."""
        learnt = []
        for item in items:
            known = self.desired.get(item.robot)
            if known is None or item.change > known.change:
                self.desired[item.robot] = item
                self.revision += 1
                learnt.append(item.robot)
        return learnt

    def report(self, robot: str, frame: link_pb2.TwinReport, *, wall_ns: int) -> Reported:
        """A robot says what it is."""
        item = Reported(
            robot=robot,
            at_ns=wall_ns,
            revision=frame.revision,
            applied=frame.applied,
            state=frame.state if frame.state in STATES else "applying",  # a newer agent's word: not known to be done
            code=_plain(frame.code, 64),
            message=_plain(frame.message, TEXT_CHARS),
            sha256=frame.sha256[:32],
            reported=frame.reported,
        )
        before = self.last(robot) if self._watchers else None
        self._remember(item)
        self._await_saving(item)
        for watcher in self._watchers:
            watcher(before, item)
        if self._listeners:
            values = reported_values(item)
            for listener in self._listeners:
                listener(robot, values)
        return item

    def last(self, robot: str) -> Reported | None:
        """The robot's last report; `reported` is empty where this gateway does not hold it."""
        item = self.reported.get(robot)
        return replace(item, reported=self._values.get(robot, b"")) if item is not None else None

    def _remember(self, item: Reported) -> None:
        """The values apart from the rest, as they are large: those that came longest ago go first."""
        self.reported[item.robot] = replace(item, reported=b"")
        self._values_bytes += len(item.reported) - len(self._values.pop(item.robot, b""))
        self._values[item.robot] = item.reported
        while self._values_bytes > LIMITS.twin_values_bytes:
            self._values_bytes -= len(self._values.pop(next(iter(self._values))))

    def _await_saving(self, item: Reported) -> None:
        """While the store takes nothing, values beyond the bound are not kept for it; the robot's next ones may be."""
        self._unsaved_bytes -= len(self._unsaved.pop(item.robot).reported) if item.robot in self._unsaved else 0
        if self._unsaved_bytes + len(item.reported) > LIMITS.twin_values_bytes:
            item = replace(item, reported=b"{}")
        self._unsaved[item.robot] = item
        self._unsaved_bytes += len(item.reported)

    async def save(self) -> None:
        """Store the reports that came since the last time; they stay to be stored where that fails."""
        while self._unsaved:
            some = dict(list(self._unsaved.items())[:SAVED_AT_ONCE])
            await self._store.run(lambda engine, some=some: write_reports(engine, some.values()))  # type: ignore[misc]
            for robot, item in some.items():
                if self._unsaved.get(robot) is item:
                    del self._unsaved[robot]
                    self._unsaved_bytes -= len(item.reported)

    def seen_revisions(self, robots: Iterable[str] | None = None) -> Mapping[str, int]:
        """The newest revision that robots have told they have seen."""
        if robots is None:
            return {robot: item.revision for robot, item in self.reported.items()}
        return {robot: self.reported[robot].revision for robot in robots if robot in self.reported}


def reported_values(item: Reported) -> dict[str, Any]:
    """What a robot reported, as values; nothing where that is no JSON object."""
    try:
        found = orjson.loads(item.reported or b"{}")
    except orjson.JSONDecodeError:
        return {}
    return found if isinstance(found, dict) else {}


def _plain(text: str, chars: int) -> str:
    return text.replace("\0", "")[:chars]
