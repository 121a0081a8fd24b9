"""`LifecycleNode`: a node that is configured, activated and shut down on request, and that may look after itself."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from typing import Any

from metaros.errors import UsageError
from metaros.executor import Timer
from metaros.node.lifecycle.health import Mode
from metaros.node.lifecycle.health_rules import HealthRule
from metaros.node.lifecycle.health_watch import HealthWatch
from metaros.node.lifecycle.hooks import HOOKS, Hook, HookSlot, drive, is_async, run_plain
from metaros.node.lifecycle.interface import Lifecycle
from metaros.node.lifecycle.managed import LifecyclePublisher
from metaros.node.lifecycle.probes import Probes
from metaros.node.lifecycle.state_machine import Result, State
from metaros.node.node import Node
from metaros.node.service import Service
from metaros.node.subscription import Subscription
from metaros.wire import QoSProfile, qos_default, qos_services

__all__ = ["LifecycleNode"]


class LifecycleNode(Node):
    """A managed node of ROS 2. Override `on_configure` … in a subclass, or decorate functions: `@node.on_configure`.

    They return None or True for success, False for failure (the node stays as it was), or raise for an error (then
    `on_error` decides: success leads to unconfigured, anything else to finalized). Each takes the previous state, or
    nothing. `on_degrade` and `on_recover` take the reason, or nothing: see `watch_health`.
    """

    on_configure: Any = Hook()
    on_cleanup: Any = Hook()
    on_activate: Any = Hook()
    on_deactivate: Any = Hook()
    on_shutdown: Any = Hook()
    on_error: Any = Hook()
    on_degrade: Any = Hook()
    on_recover: Any = Hook()

    def __init__(self, name: str, **options: Any) -> None:
        self.hook_slots: dict[str, HookSlot] = defaultdict(lambda: HookSlot(self))
        self.health: HealthWatch | None = None
        self._probes: Probes | None = None
        super().__init__(name, **options)
        self.lifecycle = Lifecycle(self)
        if any(is_async(self, hook) for hook in HOOKS):
            self.ingress.async_work = True
        self._probes = Probes(self.clock)

    @property
    def state(self) -> State:
        """Where the node is: `state.label` is unconfigured, inactive, active or finalized, or a transition's."""
        return self.lifecycle.state

    @property
    def degraded(self) -> bool:
        """Whether health has the node do with less."""
        return self.health is not None and self.health.mode is Mode.DEGRADED

    @property
    def probes(self) -> Probes:
        """What measures the node's own callbacks."""
        if self._probes is None:
            raise UsageError("a lifecycle node is probed once it is made")
        return self._probes

    def trigger(self, transition: str) -> bool:
        """Take `configure`, `activate`, `deactivate`, `cleanup` or `shutdown` now; whether it succeeded.

        UsageError where it is not possible from here, or where its callback is an `async def`: see `trigger_async`.
        """
        if is_async(self, f"on_{transition}"):
            raise UsageError(f"on_{transition} is an async def: await node.trigger_async({transition!r})")
        return run_plain(self.lifecycle.change(transition)) is Result.SUCCESS

    async def trigger_async(self, transition: str) -> bool:
        """The same for callbacks that are `async def`."""
        outcome = drive(self.lifecycle.change(transition))
        return (outcome if isinstance(outcome, Result) else await outcome) is Result.SUCCESS

    def create_subscription(
        self,
        message_type: type[Any],
        topic: str,
        callback: Callable[..., Any],
        qos: QoSProfile | int = qos_default,
        **options: Any,
    ) -> Subscription:
        """As any node's; its callback can be watched by rules under the topic's name."""
        probed = callback if self._probes is None else self._probes.around(self.resolve(topic), callback)
        return super().create_subscription(message_type, topic, probed, qos, **options)

    def create_service(
        self,
        service_type: type[Any],
        name: str,
        callback: Callable[..., Any],
        qos: QoSProfile | int = qos_services,
        **options: Any,
    ) -> Service:
        """As any node's; its callback can be watched by rules under the service's name."""
        probed = callback if self._probes is None else self._probes.around(self.resolve(name, service=True), callback)
        return super().create_service(service_type, name, probed, qos, **options)

    def create_timer(self, period_s: float, callback: Callable[[], Any], **options: Any) -> Timer:
        """As any node's; its callback can be watched by rules under the function's name."""
        name = getattr(callback, "__name__", "timer")
        probed = callback if self._probes is None else self._probes.around(name, callback)
        return super().create_timer(period_s, probed, **options)

    def create_lifecycle_publisher(
        self, message_type: type[Any], topic: str, qos: QoSProfile | int = qos_default, **options: Any
    ) -> LifecyclePublisher:
        """A publisher that is silent unless the node is active."""
        return LifecyclePublisher(self.create_publisher(message_type, topic, qos, **options), self.lifecycle.gate)

    def create_lifecycle_timer(self, period_s: float, callback: Callable[[], Any], **options: Any) -> Timer:
        """A timer that rests unless the node is active."""
        timer = self.create_timer(period_s, callback, **options)
        self.lifecycle.gate.hold(timer)
        return timer

    def watch_health(self, *rules: HealthRule, period_s: float = 0.1, grace_s: float = 2.0) -> HealthWatch:
        """Evaluate the rules every `period_s` while the node is active, `grace_s` after activation. Once a node."""
        if self.health is not None:
            raise UsageError(f"{self.full_name} watches its health already: give all rules at once")
        self.health = HealthWatch(self, self.lifecycle, self.probes, rules, period_s=period_s, grace_s=grace_s)
        return self.health

    def count_error(self) -> None:
        """Count an error that no exception told of, for the rules about errors."""
        self.probes.error()

    def close(self) -> None:
        """Shut down, with `on_shutdown`, and leave the graph."""
        if not self.closed and self._probes is not None and self.lifecycle.can("shutdown"):
            run_plain(self.lifecycle.change("shutdown"))
        super().close()
