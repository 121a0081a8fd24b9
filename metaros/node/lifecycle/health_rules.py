"""The table of health rules: which signal, for how long, and what to do about it."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from enum import Enum

from metaros.errors import UsageError
from metaros.node.lifecycle.signals import Signal

__all__ = ["Action", "Decision", "HealthRule", "Step"]


class Action(Enum):
    """What a rule does when its signal has been bad for long enough."""

    DEGRADE = "degrade"  # stay active with less: `on_degrade`, and `on_recover` when it is good again
    DEACTIVATE = "deactivate"  # rest until the signal is good again
    RECOVER = "recover"  # deactivate and activate again; once more after a while if that did not help
    RESTART = "restart"  # the same through cleanup and configure


@dataclass(frozen=True, slots=True)
class HealthRule:
    """One row. `name` is how the rule is called in logs and on `~/health`."""

    name: str
    signal: Signal
    _: KW_ONLY
    action: Action = Action.DEGRADE
    for_s: float = 1.0  # bad for so long, without a break, before anything is done
    clear_for_s: float = 2.0  # good for so long before it is taken back
    backoff: float = 2.0  # each relapse multiplies `clear_for_s`, each vain attempt `retry_s`
    clear_max_s: float = 30.0
    forget_s: float = 60.0  # without a relapse for so long, the count of relapses begins anew
    retry_s: float = 5.0  # from one attempt to recover or restart to the next
    retry_max_s: float = 60.0
    tries: int = 5  # vain attempts before the node is deactivated until the signal is good

    def __post_init__(self) -> None:
        if min(self.for_s, self.clear_for_s, self.clear_max_s, self.forget_s) < 0 or self.retry_s <= 0:
            raise UsageError(f"health rule {self.name!r}: no time may be negative, and retry_s not zero")
        if self.backoff < 1 or self.tries < 1:
            raise UsageError(f"health rule {self.name!r}: backoff and tries must be 1 or more")

    def clear_after_s(self, relapses: int) -> float:
        """How long the signal must be good, after so many relapses."""
        return min(self.clear_for_s * self.backoff ** min(relapses, 64), max(self.clear_max_s, self.clear_for_s))

    def retry_after_s(self, attempts: int) -> float:
        """How long to wait after so many vain attempts."""
        return min(self.retry_s * self.backoff ** min(attempts - 1, 64), max(self.retry_max_s, self.retry_s))


class Step(Enum):
    """What health decides: the value is the word for it in texts."""

    DEGRADE = "degraded"
    RESTORE = "recovered"
    DEACTIVATE = "deactivating"
    REACTIVATE = "reactivating"
    RECOVER = "recovering"
    RESTART = "restarting"


@dataclass(frozen=True, slots=True)
class Decision:
    """One step with its explanation: a sentence for people, the facts behind it for programs."""

    step: Step
    rule: str
    reason: str
    facts: dict[str, str]

    def __str__(self) -> str:
        return f"{self.step.value} ({self.rule}): {self.reason}"
