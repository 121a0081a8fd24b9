"""Twins for clients: read, edit one robot or many, dry-run, revert. Checked before anything is stored."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from gateway.domain.errors import TwinChangedError, UnknownRevisionError
from gateway.domain.fleet.selector import Selector, check_labels
from gateway.domain.fleet.twin import Desired, Reported, TwinEntry
from gateway.errors import ForbiddenError, UnknownRobotError
from gateway.fleet.twins.cache import TwinCache, reported_values
from gateway.fleet.twins.plan import Author, Edit, Outcome, Plan, labels_of, refusal
from gateway.fleet.twins.sender import TwinSender
from gateway.store import Store
from gateway.store.engine import StoreEngine
from gateway.store.fleet.twins import next_change, read_history, read_labels, read_reports, read_twins, write_twins
from metaros.clock import Clock
from metaros.fleet.twin import Change, diff, digest, read

__all__ = ["Editor", "TwinManager", "TwinState"]

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True, kw_only=True)
class Editor:
    """Who edits, why, and whether nodes' code is theirs to change."""

    name: str
    reason: str = ""
    code: bool = False
    confirm_within_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinState:
    """One robot: what it is to be, what it said last, and its labels. `living` is the document that it lives by."""

    desired: Desired
    reported: Reported | None
    labels: Mapping[str, str]
    living: bytes | None = None

    @property
    def in_step(self) -> bool:
        """Whether the robot lives by what is desired."""
        item = self.reported
        if not self.desired.revision:
            return item is None or not item.applied
        return item is not None and item.state == "applied" and item.applied == self.desired.revision

    @property
    def behind(self) -> list[Change]:
        """From what the robot lives by to what is desired; nothing where the former is not known."""
        if self.in_step or self.living is None:
            return []
        return diff(read(self.living), read(self.desired.document))


class TwinManager:
    """All methods on the event loop."""

    def __init__(self, store: Store, cache: TwinCache, sender: TwinSender, *, clock: Clock) -> None:
        self._store = store
        self._cache = cache
        self._sender = sender
        self._clock = clock

    def reported_of(self, robot: str) -> dict[str, Any] | None:
        """The values that the robot reported last; None where it never did, or this gateway does not hold them."""
        item = self._cache.last(robot)
        return reported_values(item) if item is not None and item.reported else None

    def desired_of(self, robot: str) -> Desired | None:
        """The robot's desired state as this gateway knows it."""
        return self._cache.desired.get(robot)

    def listen(self, listener: Callable[[str, dict[str, Any]], None]) -> None:
        """Call this with a robot and its `reported` values whenever they come."""
        self._cache.listen(listener)

    async def states(
        self, selector: Selector, sees: Callable[[str], bool], *, values_bytes: int = 0
    ) -> list[TwinState]:
        """Every robot that the selector names and that one sees, by name; values that are longer are left out."""

        def job(engine: StoreEngine) -> list[TwinState]:
            with engine.transaction(write=False):
                said, twins = read_labels(engine), read_twins(engine)
                labels = {robot: labels_of(said[robot], twins.get(robot)) for robot in sorted(said) if sees(robot)}
                named = {robot: mine for robot, mine in labels.items() if selector.matches(robot, mine)}
                some = named if len(named) < len(said) else None  # what robots report is long: of those named alone
                reports = read_reports(engine, some, values_bytes=values_bytes)
            return [self._state(robot, twins.get(robot), reports.get(robot), mine) for robot, mine in named.items()]

        return await self._store.read(job)

    async def state(self, robot: str) -> TwinState:
        """One robot; UnknownRobotError for one that never connected."""

        def job(engine: StoreEngine) -> TwinState:
            with engine.transaction(write=False):
                said, twins = read_labels(engine, [robot]), read_twins(engine, [robot])
                reports = read_reports(engine, [robot])
                if robot not in said:
                    raise UnknownRobotError.of(robot)
                labels = labels_of(said[robot], twins.get(robot))
                found = self._state(robot, twins.get(robot), reports.get(robot), labels)
                applied = found.reported.applied if found.reported is not None else 0
                entries = read_history(engine, robot, limit=1, revision=applied) if applied else []
                living = entries[0].document if entries else (None if applied else b"{}")
            return TwinState(desired=found.desired, reported=found.reported, labels=labels, living=living)

        return await self._of_known(job)

    async def history(self, robot: str, *, limit: int) -> list[TwinEntry]:
        """The robot's changes, the newest first."""

        def job(engine: StoreEngine) -> list[TwinEntry]:
            with engine.transaction(write=False):
                if robot not in read_labels(engine, [robot]):
                    raise UnknownRobotError.of(robot)
                return read_history(engine, robot, limit=limit)

        return await self._of_known(job)

    async def _of_known(self, job: Callable[[StoreEngine], Result]) -> Result:
        """Read about one robot; where it is not known, once more behind all that is on its way to the store: it may
        have connected this very moment.
        """
        try:
            return await self._store.read(job)
        except UnknownRobotError:
            await self._store.run(lambda engine: None)
            return await self._store.read(job)

    async def edit(
        self, robot: str, edit: Edit, editor: Editor, *, expected: tuple[int, int | None] | None = None, dry_run: bool
    ) -> Outcome:
        """Change one robot's own document or labels.

        `expected` is the revision, and perhaps the edition, that the editor has seen.

        Raises:
            TwinError, SelectorError: the document or a label cannot be; nothing is stored.
            TwinChangedError: it is not as `expected` any more.
            ForbiddenError: it changes what nodes run, which is not the editor's to change.
        """
        if edit.labels is not None:
            check_labels(edit.labels)

        def check(plan: Plan) -> list[str]:
            _check_expected(plan.require(robot), expected)
            return [robot]

        return (await self._change([robot], check, edit, editor, strict=True, dry_run=dry_run))[0]

    async def revert(
        self,
        robot: str,
        revision: int,
        editor: Editor,
        *,
        expected: tuple[int, int | None] | None = None,
        dry_run: bool,
    ) -> Outcome:
        """Give the robot its own document of an earlier revision; UnknownRevisionError where that is not kept."""

        def job(engine: StoreEngine) -> list[TwinEntry]:
            with engine.transaction(write=False):
                return read_history(engine, robot, limit=1, revision=revision)

        entries = await self._store.read(job)
        if not entries and revision:
            raise UnknownRevisionError(f"revision {revision} of {robot} is not kept, or never was")
        own = read(entries[0].own) if entries else {}
        return await self.edit(robot, Edit(document=own), editor, expected=expected, dry_run=dry_run)

    async def edit_many(
        self, selector: Selector, edit: Edit, editor: Editor, *, sees: Callable[[str], bool], dry_run: bool
    ) -> list[Outcome]:
        """Change every robot that the selector names and that the editor sees: all of them, or none.

        Raises:
            TwinError: some robot's document cannot be; it is named.
            ForbiddenError: as for one.
        """

        def check(plan: Plan) -> list[str]:
            return [item for item in sorted(plan.said) if sees(item) and selector.matches(item, plan.labels(item))]

        return await self._change(None, check, edit, editor, strict=False, dry_run=dry_run)

    async def _change(
        self,
        robots: Collection[str] | None,
        check: Callable[[Plan], Sequence[str]],
        edit: Edit,
        editor: Editor,
        *,
        strict: bool,
        dry_run: bool,
    ) -> list[Outcome]:
        author = Author(
            name=editor.name,
            at_ns=self._clock.wall_ns(),
            reason=editor.reason,
            confirm_within_s=editor.confirm_within_s,
        )
        cached = self._cache.seen_revisions(robots)

        def planned(engine: StoreEngine, change: int) -> list[Outcome]:
            plan = Plan(engine, robots, cached)
            outcomes = plan.outcomes(check(plan), edit, author, change=change)
            if (error := refusal(outcomes, strict=strict)) is not None:
                raise error
            if not editor.code:
                require_no_code(outcomes)
            return outcomes

        def trial(engine: StoreEngine) -> list[Outcome]:
            with engine.transaction(write=False):
                return planned(engine, 0)

        def job(engine: StoreEngine) -> list[Outcome]:
            outcomes = planned(engine, next_change(engine))
            write_twins(engine, [item.after for item in outcomes if item.changed])
            return outcomes

        if dry_run:
            return await self._of_known(trial)
        outcomes = await self._store.run(job)
        self._sender.send(self._cache.learn(item.after for item in outcomes))
        self._sender.edited()
        return outcomes

    def _state(
        self, robot: str, desired: Desired | None, stored: Reported | None, labels: Mapping[str, str]
    ) -> TwinState:
        """With the newer of what the store and this gateway have heard of it."""
        cached = self._cache.last(robot)
        if cached is not None and not cached.reported:
            cached = replace(cached, reported=stored.reported if stored is not None else b"")
        newest = max((item for item in (stored, cached) if item is not None), key=lambda item: item.at_ns, default=None)
        return TwinState(desired=desired or Desired(robot=robot, sha256=digest(b"{}")), reported=newest, labels=labels)


def require_no_code(outcomes: Sequence[Outcome]) -> None:
    """ForbiddenError when a robot would run other code than before."""
    seen: dict[tuple[bytes, ...], str] = {}
    for item in outcomes:
        key: tuple[bytes, ...] = item.before.document, item.after.document
        if item.error is not None:
            key += item.before.own, item.after.own
        if key not in seen:
            seen[key] = item.code
        if path := seen[key]:
            raise ForbiddenError(f"{path} (robot {item.before.robot}): what runs on a robot needs nodes.code")


def _check_expected(desired: Desired, expected: tuple[int, int | None] | None) -> None:
    if expected is None:
        return
    revision, edition = expected
    if desired.revision != revision or edition not in (None, desired.edition):
        now = f"{desired.revision}.{desired.edition}"
        raise TwinChangedError(f"the twin of {desired.robot} is at {now} by now: read it again")
