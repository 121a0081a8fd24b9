"""The registry of rules: what there is, who changed it and how, and the rule set in force at this gateway.

Rules are the store's: every gateway of it notices within `LOOK_S` what another one changed. All methods on the event
loop; reading rules takes place off it.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Protocol, TypeVar

import orjson

from gateway.automation.rules.document import read_rule, read_stored
from gateway.automation.rules.errors import RuleInvalidError, UnknownRuleError
from gateway.automation.rules.rule import Rule
from gateway.automation.rules.ruleset import Ruleset
from gateway.domain.automation.rule import Maker, RuleEntry, RuleStats, StoredRule
from gateway.domain.errors import ChangedError
from gateway.errors import StoreError, TooManyError
from gateway.store.automation import rules as table
from gateway.store.automation.rule_states import count_states, forget_rule
from gateway.store.engine import StoreEngine
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["Database", "RuleRegistry", "merged"]

log = logging.getLogger(__name__)
Result = TypeVar("Result")
LOOK_S = 1.0  # at what other gateways changed


class Database(Protocol):
    """What is needed of the store."""

    @property
    def shared(self) -> bool:
        """Whether other gateways change it."""

    @property
    def gateway_id(self) -> str:
        """Who changes it here."""

    async def run(self, job: Callable[[StoreEngine], Result]) -> Result:
        """A job in one write transaction."""

    async def read(self, job: Callable[[StoreEngine], Result]) -> Result:
        """A job that reads, in a transaction of its own making."""

    async def read_slowly(self, job: Callable[[StoreEngine], Result]) -> Result:
        """The same, where it takes long."""


class RuleRegistry:
    """`put_in_place` is given the set of rules whenever it is another one."""

    def __init__(
        self,
        database: Database,
        put_in_place: Callable[[Ruleset], None],
        *,
        clock: Clock,
        limits: Limits = LIMITS,
    ) -> None:
        self._database = database
        self._put_in_place = put_in_place
        self._clock = clock
        self._limits = limits
        self._head = -1
        self._read: dict[str, Rule] = {}
        self._stored: dict[str, StoredRule] = {}
        self._turn = asyncio.Lock()
        self.listeners: list[Callable[[], None]] = []

    async def start(self) -> None:
        """Know the rules of the store. Raises StoreError."""
        await self.refresh()

    async def run(self) -> None:
        """Look at what others changed, until cancelled."""
        while self._database.shared:
            await asyncio.sleep(LOOK_S)
            try:
                await self.refresh()
            except StoreError as error:
                log.debug("rules of other gateways cannot be read now: %s", error)
        await asyncio.Event().wait()

    def rules(self) -> list[Rule]:
        """Every rule that could be read, by name."""
        return [self._read[name] for name in sorted(self._read)]

    def stored(self) -> list[StoredRule]:
        """Every rule as it is stored, by name."""
        return [self._stored[name] for name in sorted(self._stored)]

    def get(self, name: str) -> StoredRule:
        """One rule; UnknownRuleError."""
        found = self._stored.get(name)
        if found is None:
            raise UnknownRuleError.of(name)
        return found

    def check(self, document: Any, maker: Maker) -> Rule:
        """The rule that a document says; RuleInvalidError."""
        return read_rule(document, maker=maker, limits=self._limits)

    async def put(self, document: Any, *, maker: Maker, expected: int | None = None) -> tuple[StoredRule, bool]:
        """Add a rule, or put another in its place; and whether it is new.

        Raises:
            RuleInvalidError: it cannot be.
            ChangedError: its revision is not `expected` any more; 0 is expected of one that is not there.
            TooManyError: there are as many as can be.
        """
        rule = await asyncio.to_thread(self.check, document, maker)
        return await self._write(rule, maker, expected, None)

    def merged(self, name: str, patch: Any, maker: Maker) -> Rule:
        """What a JSON Merge Patch (RFC 7396) makes of a rule; UnknownRuleError, RuleInvalidError."""
        if not isinstance(patch, Mapping) or patch.get("name", name) != name:
            raise RuleInvalidError("name", "a rule keeps its name; a patch is an object")
        return self.check(merged(orjson.loads(self.get(name).document), patch), maker)

    async def merge(self, name: str, patch: Any, *, maker: Maker, expected: int | None = None) -> StoredRule:
        """Change some of a rule's fields; as `put` and `merged`."""
        before = self.get(name)
        rule = await asyncio.to_thread(self.merged, name, patch, maker)
        at = before.revision if expected is None else expected
        return (await self._write(rule, maker, at, None))[0]

    async def enable(self, name: str, enabled: bool, *, by: str) -> StoredRule:
        """Turn a rule on or off; it stays its maker's. UnknownRuleError."""
        before = self.get(name)
        document = {**orjson.loads(before.document), "enabled": enabled}
        rule = await asyncio.to_thread(self.check, document, before.maker)
        what = "enabled" if enabled else "disabled"
        return (await self._write(rule, before.maker, None, what, by=by))[0]

    async def remove(self, name: str, *, by: str, expected: int | None = None) -> None:
        """Take a rule away, with all that it remembers; UnknownRuleError, ChangedError."""
        now_ns, most = self._clock.wall_ns(), self._limits.rule_entries

        def job(engine: StoreEngine) -> None:
            known = table.read_rule(engine, name)
            if known is None:
                raise UnknownRuleError.of(name)
            _check_expected(known, name, expected)
            table.remove_rule(engine, known, by=by, now_ns=now_ns, most_entries=most)
            forget_rule(engine, name)

        await self._database.run(job)
        await self.refresh()

    async def history(self, name: str, *, limit: int, before: int | None = None) -> list[RuleEntry]:
        """A rule's changes, the newest first, also of one that is gone; UnknownRuleError where there never was one."""
        found = await self._reading(lambda engine: table.rule_history(engine, name, limit=limit, before=before))
        if not found and before is None:
            raise UnknownRuleError.of(name)
        return found

    async def stats(self, names: list[str] | None = None) -> dict[str, tuple[RuleStats, int]]:
        """What rules did, and of how many groups each remembers something."""

        def job(engine: StoreEngine) -> dict[str, tuple[RuleStats, int]]:
            stats, groups = table.read_stats(engine, names), count_states(engine)
            wanted = names if names is not None else [*self._stored]
            return {name: (stats.get(name, RuleStats()), groups.get(name, 0)) for name in wanted}

        return await self._reading(job)

    async def refresh(self) -> None:
        """Go by the rules as they are in the store now. Raises StoreError."""
        async with self._turn:
            head = self._head

            def job(engine: StoreEngine) -> tuple[int, list[StoredRule]]:
                now = table.rule_head(engine)
                return now, table.read_rules(engine) if now != head else []

            now, found = await self._reading(job)
            if now == head:
                return
            ruleset, read = await asyncio.to_thread(self._arranged, found)
            self._read, self._stored = read, {item.name: item for item in found}
            self._head = now
            self._put_in_place(ruleset)
        for listener in self.listeners:
            listener()

    def _arranged(self, found: list[StoredRule]) -> tuple[Ruleset, dict[str, Rule]]:
        """Off the event loop: a thousand rules take a good part of a second."""
        read: dict[str, Rule] = {}
        for item in found:
            known = self._read.get(item.name)
            try:
                same = known is not None and known.revision == item.revision
                read[item.name] = known if same and known is not None else read_stored(item, limits=self._limits)
            except (RuleInvalidError, ValueError) as error:
                log.error("rule %s of the store is not followed here: %s", item.name, error)
        return Ruleset(read.values()), read

    async def _write(
        self, rule: Rule, maker: Maker, expected: int | None, what: str | None, *, by: str = ""
    ) -> tuple[StoredRule, bool]:
        document = orjson.dumps(rule.document).decode()
        made = StoredRule(name=rule.name, revision=0, document=document, maker=maker, changed_ns=self._clock.wall_ns())
        limits = self._limits

        def job(engine: StoreEngine) -> tuple[int, bool]:
            known = table.read_rule(engine, rule.name)
            _check_expected(known, rule.name, expected)
            if known is None and len(table.read_rules(engine)) >= limits.rules:
                raise TooManyError(f"there are {limits.rules} rules already")
            if known is None or not rule.enabled or read_stored(known).token != rule.token:
                forget_rule(engine, rule.name)
            said = what or ("created" if known is None else "changed")
            revision = table.write_rule(engine, made, what=said, by=by or maker.name, most_entries=limits.rule_entries)
            return revision, known is None

        revision, new = await self._database.run(job)
        await self.refresh()
        return replace(made, revision=revision), new

    async def _reading(self, job: Callable[[StoreEngine], Result]) -> Result:
        def read(engine: StoreEngine) -> Result:
            with engine.transaction(write=False):
                return job(engine)

        return await self._database.read(read)


def merged(document: Any, patch: Any) -> Any:
    """What a JSON Merge Patch makes of a document."""
    if not isinstance(patch, Mapping):
        return patch
    kept = dict(document) if isinstance(document, Mapping) else {}
    for name, value in patch.items():
        if value is None:
            kept.pop(name, None)
        else:
            kept[name] = merged(kept.get(name), value)
    return kept


def _check_expected(known: StoredRule | None, name: str, expected: int | None) -> None:
    now = known.revision if known is not None else 0
    if expected is not None and expected != now:
        raise ChangedError(f"rule {name} is at revision {now} by now: read it again")
