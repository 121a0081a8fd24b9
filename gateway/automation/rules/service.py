"""The rules service: registry, engine, scheduler, hooks and the intake of events, put together."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence

from gateway.automation.rules.dry_run import DryRunner
from gateway.automation.rules.evaluator import RuleEngine
from gateway.automation.rules.event_intake import EventIntake
from gateway.automation.rules.hooks import HookManager
from gateway.automation.rules.registry import Database, RuleRegistry
from gateway.automation.rules.ruleset import Ruleset
from gateway.automation.rules.scheduler import RuleScheduler
from gateway.automation.rules.secrets import Seal, Secrets, Unseal
from gateway.automation.rules.target_deliveries import FunctionPut, no_functions
from gateway.domain.automation.delivery import Put
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
        notify: Callable[[Sequence[Put]], None] = lambda puts: None,
        limits: Limits = LIMITS,
    ) -> None:
        """`notify` hears, on the writer's thread, of what was put into the queue, before that is committed."""
        gateway = database.gateway_id
        self.engine = RuleEngine(gateway, clock=clock, function_put=function_put, notify=notify, limits=limits)
        self.registry = RuleRegistry(database, self._put_in_place, clock=clock, limits=limits)
        self.scheduler = RuleScheduler(database, self.registry, self.engine, clock=clock, limits=limits)
        self.secrets = Secrets(database, seal=seal, unseal=unseal, clock=clock)
        self.intake = EventIntake(database, self.engine, clock=clock, limits=limits)
        self.hooks = HookManager(database, self.intake, self.secrets, clock=clock, limits=limits)
        self.dry_runs = DryRunner(database, clock=clock, limits=limits)

    async def start(self) -> None:
        """Know the rules: before the first commit. Raises StoreError."""
        await self.registry.start()

    async def run(self) -> None:
        """Until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self.registry.run())
            group.create_task(self.scheduler.run())

    async def close(self) -> None:
        """Store what was accepted last."""
        await self.intake.close()

    def _put_in_place(self, ruleset: Ruleset) -> None:
        self.engine.ruleset = ruleset
