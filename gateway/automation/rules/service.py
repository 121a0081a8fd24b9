"""Rules as the gateway runs them: the book, the engine that judges, the clockwork, hooks and what comes in by them."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence

from gateway.domain.delivery import Put
from gateway.rules.book import Database, RuleBook
from gateway.rules.clockwork import Clockwork
from gateway.rules.dry_run import DryRunner
from gateway.rules.evaluator import RuleEngine
from gateway.rules.firing import FunctionPut, no_functions
from gateway.rules.hooks import HookDesk
from gateway.rules.intake import Intake
from gateway.rules.ruleset import Ruleset
from gateway.rules.secrets import Seal, Secrets, Unseal
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["Rules"]


class Rules:
    """`engine` takes part in the store's commits and the journal's; all else is on the event loop."""

    def __init__(
        self,
        database: Database,
        *,
        clock: Clock,
        seal: Seal,
        unseal: Unseal,
        function_put: FunctionPut = no_functions,
        noted: Callable[[Sequence[Put]], None] = lambda puts: None,
        limits: Limits = LIMITS,
    ) -> None:
        """`noted` hears, on the writer's thread, of what was put into the queue, before that is committed."""
        gateway = database.gateway_id
        self.engine = RuleEngine(gateway, clock=clock, function_put=function_put, noted=noted, limits=limits)
        self.book = RuleBook(database, self._put_in_place, clock=clock, limits=limits)
        self.clockwork = Clockwork(database, self.book, self.engine, clock=clock, limits=limits)
        self.secrets = Secrets(database, seal=seal, unseal=unseal, clock=clock)
        self.intake = Intake(database, self.engine, clock=clock, limits=limits)
        self.hooks = HookDesk(database, self.intake, self.secrets, clock=clock, limits=limits)
        self.dry_runs = DryRunner(database, clock=clock, limits=limits)

    async def start(self) -> None:
        """Know the rules: before the first commit. Raises StoreError."""
        await self.book.start()

    async def run(self) -> None:
        """Until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self.book.run())
            group.create_task(self.clockwork.run())

    async def close(self) -> None:
        """Store what was accepted last."""
        await self.intake.close()

    def _put_in_place(self, ruleset: Ruleset) -> None:
        self.engine.ruleset = ruleset
