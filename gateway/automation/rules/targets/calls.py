"""What the handlers of targets have in common: how many deliveries at a time, and what a delivery says of its rule."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import orjson

from gateway.domain.automation.delivery import Dead, Delivery, Done, Put
from gateway.domain.automation.rule import Maker
from metaros.limits import LIMITS

__all__ = ["Calls", "OutOfScopeError", "RuleContext", "scoped_robot"]


class OutOfScopeError(Exception):
    """The rule's maker did not see the robot."""


class Calls:
    """Counts those under way; a handler of the queue, but for `deliver`."""

    def __init__(self, *, most: int = LIMITS.target_calls, timeout_s: float = LIMITS.target_s) -> None:
        self._most = most
        self._timeout_s = timeout_s
        self._under_way = 0

    def room(self, target: str | None = None) -> int:
        """How many more it takes now."""
        return max(0, self._most - self._under_way)

    def timeout_s(self, target: str) -> float:
        """The longest that one may take; a little more than what it allows itself."""
        return self._timeout_s + 5.0

    def ended(self, delivery: Delivery, result: Done | Dead) -> Sequence[Put]:
        """Nothing follows."""
        return ()

    @contextmanager
    def counted(self) -> Iterator[None]:
        """One is under way."""
        self._under_way += 1
        try:
            yield
        finally:
            self._under_way -= 1


class RuleContext:
    """The rule behind a delivery: its name, target, fields and maker."""

    def __init__(self, delivery: Delivery) -> None:
        context = delivery.put.context
        self.rule: str = context["rule"]
        self.target: str = context["target"]
        self.fields: Mapping[str, Any] = context["fields"]
        self.ended: bool = context.get("ended", False)
        self.group: str = context.get("group", "")
        said = context["maker"]
        self.maker = Maker(**{**said, "robots": tuple(said["robots"])})
        self.robot = delivery.put.robot
        self.payload = delivery.put.payload

    @property
    def name(self) -> str:
        """As people read who did it."""
        return f"rule {self.rule}"

    def document(self) -> Any:
        """What the target was given, as JSON values."""
        return orjson.loads(self.payload)


def scoped_robot(rule_context: RuleContext) -> str:
    """The robot that it is about; OutOfScopeError where the rule's maker did not see it, or there is none."""
    if not rule_context.robot or not rule_context.maker.sees(rule_context.robot):
        raise OutOfScopeError("its robot is not in the scope of who made the rule")
    return rule_context.robot
