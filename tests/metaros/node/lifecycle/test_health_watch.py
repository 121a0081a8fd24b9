"""Health on live nodes: what is measured, what is carried out, what `~/health` says. The clock is moved by hand."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

import metaros
from metaros.clock import ManualClock
from metaros.errors import UsageError
from metaros.interfaces.diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from metaros.interfaces.std_msgs.msg import String
from metaros.node.lifecycle import (
    Action,
    CallbackOverrun,
    CpuPercent,
    DeadlineMissed,
    ErrorCount,
    HealthRule,
    LifecycleNode,
    Mode,
    Temperature,
    TopicRate,
)
from tests.support.waiting import wait_until

RATE = TopicRate("scan", below_hz=5)


class Consumer(LifecycleNode):
    """Subscribes to /scan and notes what happens to it; `runs` lets time pass with messages at a rate."""

    def __init__(self, clock: ManualClock, context: metaros.Context) -> None:
        super().__init__("consumer", context=context)
        self.manual = clock
        self.calls: list[str] = []
        self.fails = False
        self.subscription_ = self.create_subscription(String, "scan", self.on_scan)
        self.executor = metaros.SingleThreadedExecutor()
        self.executor.add_node(self)

    def on_scan(self, message: String) -> None:
        if message.data:
            raise RuntimeError(message.data)

    def on_configure(self) -> bool:
        self.calls.append("configure")
        return not self.fails

    def on_activate(self) -> None:
        self.calls.append("activate")

    def on_deactivate(self) -> None:
        self.calls.append("deactivate")

    def on_cleanup(self) -> None:
        self.calls.append("cleanup")

    def on_degrade(self, reason: str) -> None:
        self.calls.append(f"degrade: {reason}")

    def on_recover(self, reason: str) -> None:
        self.calls.append(f"recover: {reason}")

    def start(self) -> None:
        assert self.trigger("configure")
        assert self.trigger("activate")
        self.calls.clear()

    def runs(self, seconds: float, rate_hz: float, text: str = "", then: Callable[[], object] = lambda: None) -> None:
        """Every 20 ms of manual time the executor has its turn; messages come as they would from the wire."""
        ticks, sent = round(seconds / 0.02), 0
        for tick in range(1, ticks + 1):
            self.manual.advance(0.02)
            while sent < tick * 0.02 * rate_hz - 1e-9:
                sent += 1
                try:
                    self.subscription_.callback(String(data=text))
                except RuntimeError:
                    continue
            then()
            self.executor.spin_once(0.0)


@pytest.fixture
def consumer(still, manual):
    with Consumer(manual, still) as node:
        yield node
        node.executor.shutdown()


def test_degrades_at_2_hz_says_why_and_recovers_by_itself(consumer, here, capsys):
    seen: list[DiagnosticArray] = []
    watch = consumer.watch_health(HealthRule("lidar", RATE, for_s=1.0, clear_for_s=2.0))
    consumer.start()
    consumer.runs(5.0, 10.0)
    assert (consumer.degraded, consumer.calls) == (False, [])
    consumer.runs(5.0, 2.0)
    assert consumer.degraded
    assert consumer.state.label == "active"
    (call,) = consumer.calls
    assert call.startswith("degrade: scan comes at ")
    assert call.endswith(" Hz (wanted: 5 Hz) for 1 s")
    assert f"[WARN] [{consumer.manual.wall_ns() // 10**12}" in (err := capsys.readouterr().err)
    assert "degraded (lidar): scan comes at" in err
    with metaros.Node("late", context=here) as late:  # a late subscription learns of it all the same
        late.create_subscription(DiagnosticArray, "/consumer/health", seen.append, metaros.qos_transient_local)
        ears = metaros.SingleThreadedExecutor()
        ears.add_node(late)
        wait_until(lambda: ears.spin_once(0.05) and seen)
        whole, rule = seen[-1].status
        assert (whole.level, whole.name) == (DiagnosticStatus.WARN, "/consumer")
        assert whole.message.startswith("degraded: lidar: scan comes at")
        facts = {pair.key: pair.value for pair in whole.values}
        assert (facts["state"], facts["mode"], facts["rule"]) == ("active", "degraded", "lidar")
        assert (rule.name, rule.level) == ("/consumer: lidar", DiagnosticStatus.WARN)
        assert {pair.key: pair.value for pair in rule.values}["tripped"] == "true"
        consumer.runs(6.0, 10.0)
        wait_until(lambda: ears.spin_once(0.05) and seen[-1].status[0].level == DiagnosticStatus.OK)
        ears.shutdown()
    assert not consumer.degraded
    assert consumer.calls[1].startswith("recover: scan comes at 10.0 Hz")
    assert len(watch.decisions) == 2
    assert "recovered (lidar)" in capsys.readouterr().err


def test_deactivates_and_reactivates(consumer):
    watch = consumer.watch_health(HealthRule("motor", Temperature("motor", above_c=80), action=Action.DEACTIVATE))
    consumer.start()
    consumer.runs(4.0, 0.0, then=lambda: watch.feed("temperature motor", 90.0))
    assert (consumer.state.label, watch.mode, consumer.calls) == ("inactive", Mode.DOWN, ["deactivate"])
    consumer.runs(4.0, 0.0, then=lambda: watch.feed("temperature motor", 60.0))
    assert (consumer.state.label, watch.mode) == ("active", Mode.HEALTHY)
    assert consumer.calls == ["deactivate", "activate"]


def test_what_is_no_longer_fed_is_not_judged(consumer):
    watch = consumer.watch_health(HealthRule("motor", Temperature("motor", above_c=80), for_s=7.0))
    consumer.start()
    watch.feed("temperature motor", 90.0)
    with pytest.raises(UsageError, match="no health rule reads 'motor'; there are 'temperature motor'"):
        watch.feed("motor", 90.0)
    consumer.runs(20.0, 0.0)
    assert consumer.calls == []


@pytest.mark.parametrize(
    ("action", "cycle"),
    [
        (Action.RECOVER, ["deactivate", "activate"]),
        (Action.RESTART, ["deactivate", "cleanup", "configure", "activate"]),
    ],
)
def test_recover_and_restart(consumer, action, cycle):
    consumer.watch_health(HealthRule("lidar", RATE, action=action))
    consumer.start()
    consumer.runs(4.5, 1.0)
    assert consumer.calls == cycle
    consumer.runs(10.0, 10.0)
    assert consumer.calls == cycle
    assert consumer.state.label == "active"


def test_a_restart_that_fails_is_tried_again(consumer):
    watch = consumer.watch_health(HealthRule("lidar", RATE, action=Action.RESTART))
    consumer.start()
    consumer.fails = True
    consumer.runs(4.5, 1.0)
    assert (consumer.state.label, watch.mode) == ("unconfigured", Mode.DOWN)
    consumer.fails = False
    consumer.runs(6.0, 10.0)
    assert (consumer.state.label, watch.mode) == ("active", Mode.HEALTHY)
    assert consumer.calls[-2:] == ["configure", "activate"]


def test_what_an_operator_does_is_not_taken_back(consumer):
    watch = consumer.watch_health(HealthRule("lidar", RATE, action=Action.DEACTIVATE))
    consumer.start()
    consumer.runs(4.0, 1.0)
    assert watch.mode is Mode.DOWN
    assert consumer.trigger("cleanup")
    consumer.runs(10.0, 10.0)
    assert (consumer.state.label, watch.mode) == ("unconfigured", Mode.HEALTHY)


def test_errors_deadlines_and_overruns_are_measured(consumer, manual):
    watch = consumer.watch_health(
        HealthRule("errors", ErrorCount(at_least=4, window_s=5.0), for_s=0.0),
        HealthRule("deadline", DeadlineMissed("/scan", deadline_s=0.5), for_s=0.0),
        HealthRule("slow", CallbackOverrun("think", over_s=0.05), for_s=0.0),
        HealthRule("any", CallbackOverrun(over_s=5.0), for_s=0.0),
    )

    def think() -> None:
        manual.advance(0.06)

    consumer.start()
    consumer.runs(4.0, 10.0)
    assert consumer.calls == []
    consumer.runs(0.3, 10.0, text="broken")
    consumer.count_error()
    consumer.runs(1.0, 10.0)
    consumer.runs(1.0, 0.0)
    timer = consumer.create_timer(0.5, think)
    consumer.runs(1.0, 10.0)
    timer.cancel()
    assert [decision.rule for decision in watch.decisions] == ["errors", "deadline", "slow"]
    assert watch.decisions[0].reason == "errors in 5 s: 4 (allowed: 3)"
    assert watch.decisions[2].reason.startswith("think took up to 60 ms (allowed: 50 ms)")
    consumer.runs(12.0, 10.0)
    assert not consumer.degraded


def test_async_hooks_and_subscriptions(still, manual):
    async def hook(*_: Any) -> None:
        await asyncio.sleep(0)
        calls.append("degrade")

    async def hear(message: String) -> None:
        await asyncio.sleep(0)
        manual.advance(0.2)

    calls: list[str] = []
    with LifecycleNode("consumer", context=still) as node:
        node.on_degrade(hook)
        subscription = node.create_subscription(String, "scan", hear)
        node.watch_health(HealthRule("slow", CallbackOverrun("/scan", over_s=0.1), for_s=0.0), grace_s=0.0)
        node.trigger("configure")
        node.trigger("activate")
        asyncio.run(subscription.callback(String()))
        executor = metaros.SingleThreadedExecutor()
        executor.add_node(node)
        wait_until(lambda: executor.spin_once(0.01) and calls)
        executor.shutdown()
    assert calls == ["degrade"]


def test_cpu_is_read_where_psutil_is(consumer):
    pytest.importorskip("psutil")
    watch = consumer.watch_health(
        HealthRule("cpu", CpuPercent(above=1e6)), HealthRule("host", CpuPercent(above=1e6, of="host"))
    )
    consumer.start()
    consumer.runs(3.0, 0.0)
    assert all(state.value is not None and state.value >= 0.0 for state in watch.health.rules)


def test_one_watch_a_node_and_unsubscribed_topics(consumer):
    watch = consumer.watch_health(HealthRule("elsewhere", TopicRate("/elsewhere", below_hz=5)))
    with pytest.raises(UsageError, match="watches its health already"):
        consumer.watch_health()
    consumer.start()
    consumer.runs(5.0, 0.0)
    assert watch.health.rules[0].describe() == "not measured"
    assert watch.mode is Mode.HEALTHY


def test_a_finalized_node_stays_finalized(consumer, capsys):
    watch = consumer.watch_health(HealthRule("lidar", RATE, action=Action.RESTART))
    consumer.start()
    consumer.on_configure = lambda: 1 / 0  # and there is no on_error
    consumer.runs(60.0, 1.0)
    assert consumer.state.label == "finalized"
    assert len(watch.decisions) == 1
    assert "restarting (lidar) failed: finalized now" in capsys.readouterr().err
