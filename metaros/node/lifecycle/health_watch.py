"""Health on a live node: measures what the rules ask for, carries out what they decide, and says why.

The rules are judged by a timer of the node. Every decision is logged, and stands on `~/health` for whoever comes late.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from typing import Any, Final

from metaros.errors import UsageError
from metaros.node.lifecycle.health import Health, Mode
from metaros.node.lifecycle.health_report import HealthReport
from metaros.node.lifecycle.health_rules import Decision, HealthRule, Step
from metaros.node.lifecycle.hooks import Steps, ask, drive
from metaros.node.lifecycle.interface import Lifecycle
from metaros.node.lifecycle.meters import GapMeter, RateMeter, WindowMax
from metaros.node.lifecycle.probes import Probe, Probes
from metaros.node.lifecycle.signals import CallbackOverrun, CpuPercent, DeadlineMissed, ErrorCount, Signal, TopicRate
from metaros.node.lifecycle.state_machine import ACTIVE, FINALIZED, INACTIVE, UNCONFIGURED, Result, Transition
from metaros.node.node import Node

__all__ = ["HealthWatch"]

_FED_S: Final = 5.0  # what was fed is too old to be judged after so long
_REPORT_S: Final = 1.0
_WAYS: Final = {
    Step.DEACTIVATE: ("deactivate",),
    Step.RECOVER: ("deactivate",),
    Step.RESTART: ("deactivate", "cleanup"),
}
_UP: Final = {UNCONFIGURED: "configure", INACTIVE: "activate"}
Reading = Callable[[float], "float | None"]


class HealthWatch:
    """The health of one node: `mode`, `decisions` (the latest 100), and `feed` for what only the node can measure."""

    def __init__(
        self,
        node: Node,
        lifecycle: Lifecycle,
        probes: Probes,
        rules: Sequence[HealthRule],
        *,
        period_s: float = 0.1,
        grace_s: float = 2.0,
    ) -> None:
        self._node = node
        self._lifecycle = lifecycle
        self._probes = probes
        self._moving = False
        self._fed: dict[str, tuple[float, float]] = {}
        self._gaps: list[GapMeter] = []
        self.health = Health(rules, now_s=node.clock.monotonic_s(), grace_s=grace_s)
        self.decisions: list[Decision] = []
        self._readings = {rule.signal.key: self._measure(rule.signal) for rule in rules}
        self._report = HealthReport(node)
        self._report_at_s = 0.0
        lifecycle.on_transition.append(self._on_transition)
        Node.create_timer(node, period_s, self._tick)  # unprobed: it is no callback of the user's

    @property
    def mode(self) -> Mode:
        """Healthy, degraded, or kept from being active."""
        return self.health.mode

    def feed(self, key: str, value: float) -> None:
        """A reading that the node took itself, by the signal's key, such as `temperature motor`."""
        if key not in self._readings:
            raise UsageError(f"no health rule reads {key!r}; there are {', '.join(map(repr, self._readings))}")
        self._fed[key] = (self._node.clock.monotonic_s(), value)

    # -- measuring -------------------------------------------------------------------------------------------------

    def _measure(self, signal: Signal) -> Reading:
        """How to read a signal; what is not known here has to be fed."""
        node, probes = self._node, self._probes
        if isinstance(signal, TopicRate):
            probe, rate = probes.named(node.resolve(signal.topic)), RateMeter(signal.window_s)
            probe.starts.append(rate.tick)
            return _while_subscribed(probe, rate.rate_hz)
        if isinstance(signal, DeadlineMissed):
            now_s = node.clock.monotonic_s()
            probe, gaps = probes.named(node.resolve(signal.topic)), GapMeter(signal.deadline_s, signal.window_s, now_s)
            probe.starts.append(gaps.tick)
            self._gaps.append(gaps)
            return _while_subscribed(probe, gaps.missed)
        if isinstance(signal, CallbackOverrun):
            longest = WindowMax(signal.window_s)
            probes.named(signal.callback).durations.append(longest.put)
            return longest.greatest
        if isinstance(signal, ErrorCount):
            errors = RateMeter(signal.window_s)
            probes.errors.append(errors.tick)
            return errors.count
        if isinstance(signal, CpuPercent) and (measured := _cpu(signal)) is not None:
            return lambda now_s: measured()
        return lambda now_s: self._latest(signal.key, now_s)

    def _latest(self, key: str, now_s: float) -> float | None:
        fed_s, value = self._fed.get(key, (0.0, None))
        return value if now_s - fed_s <= _FED_S else None

    def _on_transition(self, transition: Transition) -> None:
        """Whatever moves the node, measuring begins anew with it; what others move, health does not take back."""
        now_s = self._node.clock.monotonic_s()
        if transition.goal == ACTIVE:
            with self._probes.lock:
                for gaps in self._gaps:
                    gaps.begin(now_s)
        if not self._moving:
            self.health.reset(now_s)
            self._report_at_s = now_s

    # -- acting ----------------------------------------------------------------------------------------------------

    def _tick(self) -> Any:
        node, lifecycle, now_s = self._node, self._lifecycle, self._node.clock.monotonic_s()
        if node.closed or not lifecycle.state.primary or lifecycle.state == FINALIZED:
            return None  # a callback of the lifecycle is under way, or none will ever be
        with self._probes.lock:
            readings = {key: read(now_s) for key, read in self._readings.items()}
        decisions = self.health.step(now_s, readings, active=lifecycle.state == ACTIVE)
        if not decisions and now_s < self._report_at_s:
            return None
        return drive(self._act(decisions, now_s))

    def _act(self, decisions: list[Decision], now_s: float) -> Steps[None]:
        for decision in decisions:
            self._explain(decision)
            if decision.step in (Step.DEGRADE, Step.RESTORE):
                name = "on_degrade" if decision.step is Step.DEGRADE else "on_recover"
                yield from ask(self._node, name, decision.reason)
                continue
            self._moving = True
            try:
                yield from self._move(decision.step)
            finally:
                self._moving = False
            now_s = self._node.clock.monotonic_s()
            state = self._lifecycle.state
            self.health.carried_out(now_s, decision, active=state == ACTIVE)
            if (state == ACTIVE) is (decision.step is Step.DEACTIVATE):
                self._node.get_logger().error(f"{decision.step.value} ({decision.rule}) failed: {state.label} now")
        latest = self.decisions[-1] if self.decisions else None
        self._report.publish(self.health, latest, state=self._lifecycle.state)
        self._report_at_s = now_s + _REPORT_S

    def _move(self, step: Step) -> Steps[None]:
        """Down as far as the step says, then up to active; a transition that fails ends it."""
        lifecycle = self._lifecycle
        for wanted in _WAYS.get(step, ()):
            if lifecycle.can(wanted) and (yield from lifecycle.change(wanted)) is not Result.SUCCESS:
                return
        if step is Step.DEACTIVATE:
            return
        while (wanted := _UP.get(lifecycle.state, "")) and lifecycle.can(wanted):
            if (yield from lifecycle.change(wanted)) is not Result.SUCCESS:
                return

    def _explain(self, decision: Decision) -> None:
        self.decisions.append(decision)
        del self.decisions[:-100]
        logger = self._node.get_logger()
        (logger.info if decision.step in (Step.RESTORE, Step.REACTIVATE) else logger.warn)(str(decision))


def _while_subscribed(probe: Probe, read: Callable[[float], float]) -> Reading:
    """A topic that nobody here subscribes to is not measured."""
    return lambda now_s: read(now_s) if probe.callbacks else None


def _cpu(signal: CpuPercent) -> Callable[[], float] | None:
    """psutil's reading, where it is installed."""
    try:
        psutil: Any = importlib.import_module("psutil")
    except ModuleNotFoundError:
        return None
    source: Callable[[], float] = psutil.Process().cpu_percent if signal.of == "process" else psutil.cpu_percent
    source()  # the first call only begins to measure
    return source
