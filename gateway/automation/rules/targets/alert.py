"""Opens an alert of a robot, with the rule for its cause, and lets it be over when what the rule waited for is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol

from gateway.automation.rules.targets.calls import Calls, OutOfScopeError, RuleContext, scoped_robot
from gateway.domain.automation.delivery import Dead, Delivery, Done, Put, Result
from gateway.domain.finding import Edge, Finding
from metaros.clock import Clock

__all__ = ["AlertTarget", "Alerts"]

REASON_CHARS = 500


class Alerts(Protocol):
    """What is needed of the alert manager."""

    def report(self, edges: Sequence[Edge]) -> None:
        """What was found."""

    async def save(self) -> None:
        """Store what came of it. Raises StoreError."""


class AlertTarget:
    """A handler of the queue. The same finding told twice is one alert."""

    def __init__(self, alerts: Alerts, *, clock: Clock) -> None:
        self._calls = Calls()
        self.room, self.timeout_s, self.ended = self._calls.room, self._calls.timeout_s, self._calls.ended
        self._alerts = alerts
        self._clock = clock

    async def deliver(self, delivery: Delivery) -> Result:
        """Tell the alert manager, and have it stored."""
        rule_context = RuleContext(delivery)
        try:
            robot = scoped_robot(rule_context)
        except OutOfScopeError as error:
            return Dead("out_of_scope", str(error))
        finding = self._finding(rule_context, robot)
        now_s = self._clock.wall_ns() / 1e9
        with self._calls.counted():
            self._alerts.report([Edge("cleared" if rule_context.ended else "opened", finding, now_s)])
            await self._alerts.save()
        return Done(f"rule:{rule_context.rule}", puts=self._over_later(delivery, rule_context))

    def _over_later(self, delivery: Delivery, rule_context: RuleContext) -> tuple[Put, ...]:
        """What is to last for a while only ends by itself."""
        for_s = rule_context.fields.get("for_s")
        if for_s is None or rule_context.ended:
            return ()
        due_ns = self._clock.wall_ns() + round(for_s * 1e9)
        context = {**delivery.put.context, "ended": True}
        return (replace(delivery.put, context=context, due_ns=due_ns, dedup=f"{delivery.id}/over"),)

    def _finding(self, rule_context: RuleContext, robot: str) -> Finding:
        said = rule_context.document()
        detail = said.get("detail", said.get("data", {})) if isinstance(said, dict) else {}
        value = detail.get("value") if isinstance(detail, dict) else None
        return Finding(
            robot=robot,
            series=_series(detail, rule_context),
            kind=f"rule:{rule_context.rule}",
            cause=f"rule:{rule_context.rule}",
            severity=rule_context.fields.get("severity", "warning"),
            score=1.0,
            value=float(value) if isinstance(value, int | float) and not isinstance(value, bool) else math.nan,
            low=math.nan,
            high=math.nan,
            reason=str(rule_context.fields.get("reason") or f"rule {rule_context.rule} fired")[:REASON_CHARS],
            since_s=self._clock.wall_ns() / 1e9,
        )


def _series(detail: Any, rule_context: RuleContext) -> str:
    found = detail.get("series") or detail.get("topic") if isinstance(detail, dict) else ""
    return str(found or rule_context.group)[:256]
