"""Templates: parts of documents for many robots at once. A change reaches every robot that it names, or none."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from gateway.domain.errors import TwinChangedError, UnknownRevisionError, UnknownTemplateError
from gateway.domain.fleet.selector import Selector
from gateway.domain.fleet.twin import Template, TemplateEntry, is_template_name
from gateway.errors import InvalidRequestError
from gateway.fleet.twins.cache import TwinCache
from gateway.fleet.twins.manager import Editor, require_no_code
from gateway.fleet.twins.plan import Author, Edit, Outcome, Plan, refusal
from gateway.fleet.twins.sender import TwinSender
from gateway.store import Store
from gateway.store.engine import StoreEngine
from gateway.store.fleet.templates import read_template_history, read_templates, remove_template, write_template
from gateway.store.fleet.twins import next_change, write_twins
from metaros.clock import Clock
from metaros.fleet.twin import parse_part

__all__ = ["MAX_PRIORITY", "TemplateManager"]

MAX_PRIORITY = 1000


class TemplateManager:
    """All methods on the event loop."""

    def __init__(self, store: Store, cache: TwinCache, sender: TwinSender, *, clock: Clock) -> None:
        self._store = store
        self._cache = cache
        self._sender = sender
        self._clock = clock

    async def all(self) -> Sequence[Template]:
        """Every template, in the order in which they are laid over each other."""

        def job(engine: StoreEngine) -> dict[str, Template]:
            with engine.transaction(write=False):
                return read_templates(engine)

        found = await self._store.read(job)
        return sorted(found.values(), key=lambda item: (item.priority, item.name))

    async def get(self, name: str) -> Template:
        """One template; UnknownTemplateError when there is none of that name."""
        for item in await self.all():
            if item.name == name:
                return item
        raise UnknownTemplateError(f"there is no template {name[:64]!r}")

    async def put(
        self,
        name: str,
        *,
        selector: str,
        document: Mapping[str, Any],
        priority: int,
        editor: Editor,
        expected: int | None = None,
        dry_run: bool,
    ) -> tuple[Template, list[Outcome]]:
        """Add a template or put another in its place; with what becomes of each robot that it changes.

        Raises:
            TwinError, SelectorError: it cannot be, or would break a robot's document; nothing is stored.
            TwinChangedError: its revision is not `expected` any more; 0 is expected of one that is not there.
        """
        if not is_template_name(name):
            raise InvalidRequestError("a template's name is 1 to 64 letters, digits, _ . and -")
        if not -MAX_PRIORITY <= priority <= MAX_PRIORITY:
            raise InvalidRequestError(f"priority is -{MAX_PRIORITY} to {MAX_PRIORITY}, not {priority}")
        wanted, part = Selector.parse(selector), parse_part(document)

        def change(plan: Plan, number: int) -> Template:
            _check_expected(plan.templates.get(name), name, expected)
            item = Template(
                name=name,
                selector=wanted,
                document=part,
                priority=priority,
                revision=number,
                author=editor.name,
                at_ns=self._clock.wall_ns(),
                reason=editor.reason,
            )
            plan.templates[name] = item
            return item

        return await self._change(change, editor, f"template {name}", dry_run=dry_run)

    async def remove(
        self, name: str, *, editor: Editor, expected: int | None = None, dry_run: bool
    ) -> tuple[Template, list[Outcome]]:
        """Take a template away; as `put`, and UnknownTemplateError when there is none of that name."""

        def change(plan: Plan, number: int) -> Template:
            if name not in plan.templates:
                raise UnknownTemplateError(f"there is no template {name[:64]!r}")
            _check_expected(plan.templates[name], name, expected)
            return plan.templates.pop(name)

        return await self._change(change, editor, f"template {name} removed", removes=True, dry_run=dry_run)

    async def history(self, name: str, *, limit: int) -> list[TemplateEntry]:
        """The template's changes, the newest first; UnknownTemplateError where there is none, and was none."""

        def job(engine: StoreEngine) -> list[TemplateEntry]:
            with engine.transaction(write=False):
                return read_template_history(engine, name, limit=limit)

        found = await self._store.read(job)
        if not found:
            raise UnknownTemplateError(f"there is no template {name[:64]!r}")
        return found

    async def revert(
        self, name: str, revision: int, *, editor: Editor, expected: int | None = None, dry_run: bool
    ) -> tuple[Template, list[Outcome]]:
        """The template as it was at an earlier revision, also of one that is gone; as `put`.

        UnknownRevisionError where that is not kept.
        """

        def job(engine: StoreEngine) -> list[TemplateEntry]:
            with engine.transaction(write=False):
                return read_template_history(engine, name, limit=1, revision=revision)

        found = await self._store.read(job)
        if not found:
            raise UnknownRevisionError(f"revision {revision} of template {name[:64]!r} is not kept, or never was")
        old = found[0].template
        return await self.put(
            name,
            selector=old.selector.text,
            document=old.document,
            priority=old.priority,
            editor=editor,
            expected=expected,
            dry_run=dry_run,
        )

    async def _change(
        self,
        change: Callable[[Plan, int], Template],
        editor: Editor,
        said: str,
        *,
        removes: bool = False,
        dry_run: bool,
    ) -> tuple[Template, list[Outcome]]:
        reason = f"{said}: {editor.reason}" if editor.reason else said
        author = Author(
            name=editor.name, at_ns=self._clock.wall_ns(), reason=reason, confirm_within_s=editor.confirm_within_s
        )
        seen_revisions = self._cache.seen_revisions()

        def planned(engine: StoreEngine, number: int) -> tuple[Template, list[Outcome]]:
            plan = Plan(engine, None, seen_revisions)
            item = change(plan, number)
            outcomes = [one for one in plan.outcomes(sorted(plan.said), Edit(), author, change=number) if one.changed]
            if (error := refusal(outcomes)) is not None:
                raise error
            if not editor.code:
                require_no_code(outcomes)
            return item, outcomes

        def trial(engine: StoreEngine) -> tuple[Template, list[Outcome]]:
            with engine.transaction(write=False):
                return planned(engine, 0)

        def job(engine: StoreEngine) -> tuple[Template, list[Outcome]]:
            number = next_change(engine, templates=True)
            item, outcomes = planned(engine, number)
            if removes:
                signed = replace(item, revision=number, author=author.name, at_ns=author.at_ns, reason=editor.reason)
                remove_template(engine, signed)
            else:
                write_template(engine, item)
            write_twins(engine, [one.after for one in outcomes])
            return item, outcomes

        if dry_run:
            return await self._store.read(trial)
        item, outcomes = await self._store.run(job)
        await self._sender.refresh()
        self._sender.edited()
        return item, outcomes


def _check_expected(known: Template | None, name: str, expected: int | None) -> None:
    now = known.revision if known is not None else 0
    if expected is not None and expected != now:
        raise TwinChangedError(f"template {name} is at revision {now} by now: read it again")
