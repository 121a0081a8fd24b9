"""`~/health`: the node's health as standard diagnostics, kept for late subscribers."""

from __future__ import annotations

from typing import Final

from metaros.interfaces.builtin_interfaces.msg import Time
from metaros.interfaces.diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from metaros.interfaces.std_msgs.msg import Header
from metaros.node.lifecycle.health import Health, Mode, RuleState
from metaros.node.lifecycle.health_rules import Action, Decision
from metaros.node.lifecycle.state_machine import ACTIVE, State
from metaros.node.node import Node
from metaros.wire import qos_transient_local

__all__ = ["HealthReport"]

_LEVELS: Final = {
    Mode.HEALTHY: DiagnosticStatus.OK,
    Mode.DEGRADED: DiagnosticStatus.WARN,
    Mode.DOWN: DiagnosticStatus.ERROR,
}


class HealthReport:
    """Publishes a DiagnosticArray: first the node with its latest decision, then one status a rule."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publisher = node.create_publisher(DiagnosticArray, "~/health", qos_transient_local)

    def publish(self, health: Health, latest: Decision | None, *, state: State) -> None:
        """Say how things are."""
        seconds, nanoseconds = divmod(self._node.clock.wall_ns(), 1_000_000_000)
        status = [self._overall(health, latest, state), *(self._rule(rule) for rule in health.rules)]
        stamp = Time(sec=seconds, nanosec=nanoseconds)
        self._publisher.publish(DiagnosticArray(header=Header(stamp=stamp), status=status))

    def _overall(self, health: Health, latest: Decision | None, state: State) -> DiagnosticStatus:
        mode = health.mode
        facts = {"state": state.label, "mode": mode.value}
        if latest is not None:
            facts |= {"step": latest.step.value, "rule": latest.rule, "reason": latest.reason, **latest.facts}
        tripped = "; ".join(f"{rule.rule.name}: {rule.describe()}" for rule in health.rules if rule.tripped)
        resting = "" if state == ACTIVE or mode is Mode.DOWN else f" ({state.label}: not judged)"
        return DiagnosticStatus(
            level=_LEVELS[mode],
            name=self._node.full_name,
            message=f"{mode.value}{resting}{': ' if tripped else ''}{tripped}",
            values=_values(facts),
        )

    def _rule(self, state: RuleState) -> DiagnosticStatus:
        rule = state.rule
        bad = DiagnosticStatus.WARN if rule.action is Action.DEGRADE else DiagnosticStatus.ERROR
        facts = {
            "signal": rule.signal.key,
            "value": "" if state.value is None else f"{state.value:.6g}",
            "action": rule.action.value,
            "tripped": str(state.tripped).lower(),
            "relapses": str(state.relapses),
            "attempts": str(state.attempts),
        }
        return DiagnosticStatus(
            level=bad if state.tripped else DiagnosticStatus.OK,
            name=f"{self._node.full_name}: {rule.name}",
            message=state.describe(),
            values=_values(facts),
        )


def _values(facts: dict[str, str]) -> list[KeyValue]:
    return [KeyValue(key=key, value=value) for key, value in facts.items()]
