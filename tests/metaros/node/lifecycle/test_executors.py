"""A lifecycle node with plain and async callbacks, health and a resting timer under every executor."""

from __future__ import annotations

import asyncio
import threading
from typing import Any

import pytest

import metaros
from metaros import executor as executors
from metaros.interfaces.lifecycle_msgs import msg, srv
from metaros.node.lifecycle import Action, ErrorCount, HealthRule, LifecycleNode, Temperature
from tests.support.waiting import wait_until

RULES = (
    HealthRule("errors", ErrorCount(at_least=1), for_s=0.0),
    HealthRule("motor", Temperature("motor", above_c=80), action=Action.RESTART, for_s=0.0),
)


@pytest.mark.parametrize("kind", ["SingleThreadedExecutor", "MultiThreadedExecutor", "AsyncioExecutor", "FairExecutor"])
def test_a_life_under_every_executor(kind, here, there):
    calls: list[str] = []
    ticks: list[str] = []
    with LifecycleNode("arm", context=here) as node, metaros.Node("asker", context=there) as asker:

        @node.on_configure
        async def configure() -> None:
            await asyncio.sleep(0.001)
            calls.append("configure")

        node.on_degrade(lambda: calls.append("degrade"))
        node.on_deactivate(lambda: calls.append("deactivate"))
        node.create_lifecycle_timer(0.02, lambda: ticks.append(node.state.label))
        watch = node.watch_health(*RULES, period_s=0.02, grace_s=0.0)
        executor: Any = getattr(executors, kind)()
        executor.add_node(node)
        thread = threading.Thread(target=executor.spin)
        thread.start()
        try:
            client = asker.create_client(srv.ChangeState, "/arm/change_state")
            assert client.wait_for_service(60)
            for label in ("configure", "activate"):
                assert client.call(srv.ChangeState.Request(transition=msg.Transition(label=label))).success
            node.count_error()
            wait_until(lambda: node.degraded and ticks)
            watch.feed("temperature motor", 90.0)
            wait_until(lambda: calls == ["configure", "degrade", "deactivate", "configure"])
            wait_until(lambda: node.state.label == "active")
        finally:
            executor.shutdown()
            thread.join()
    assert node.state.label == "finalized"
