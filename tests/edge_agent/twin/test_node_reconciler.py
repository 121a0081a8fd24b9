"""Parameters and lifecycle of nodes that come, go, refuse and do not answer, without a wire."""

from __future__ import annotations

import asyncio
import random  # noqa: TID251 - seeded
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from typing import Any

import pytest

from edge_agent.errors import DiskError
from edge_agent.forwarding.scope import Scope
from edge_agent.twin import node_reconciler as module
from edge_agent.twin.initial_values import InitialValues
from edge_agent.twin.lifecycle import next_step
from edge_agent.twin.node_reconciler import NodeReconciler
from metaros.errors import UnavailableError
from metaros.node.parameters import SetResult
from tests.support.robots.ros_nodes import STEPS, RosNodes
from tests.support.simulation.sim_disk import SimDisk
from tests.support.waiting import wait_until_async


@asynccontextmanager
async def seeing_to(nodes: RosNodes, disk: SimDisk | None = None) -> AsyncIterator[NodeReconciler]:
    values = NodeReconciler(nodes, Scope("/r"), InitialValues(disk or SimDisk(random.Random(1))))
    task = asyncio.create_task(values.run())
    try:
        yield values
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
    assert not nodes.told


def parameters(values: NodeReconciler, node: str = "/r/a") -> dict[str, Any]:
    return dict(values.reported()["parameters"][node])


async def test_values_are_fitted_to_the_kind_that_the_node_has() -> None:
    nodes = RosNodes(a={"rate": 1.0, "on": True, "sizes": [1.0, 2.0]})
    async with seeing_to(nodes) as values:
        values.want({"a": {"rate": 2, "on": "yes", "sizes": [3, 4], "new": 1}}, None)
        await wait_until_async(lambda: parameters(values)["state"] == "refused")
    assert nodes.nodes["/r/a"] == {"rate": 2.0, "on": True, "sizes": [3.0, 4.0], "new": 1}
    assert set(parameters(values)["refused"]) == {"on"}


async def test_a_node_is_seen_to_again_after_each_of_its_starts() -> None:
    nodes = RosNodes(a={"rate": 1.0})
    async with seeing_to(nodes) as values:
        values.want({"/r/a": {"rate": 2.0}, "/r/late": {"x": 1}}, None)
        await wait_until_async(lambda: parameters(values)["state"] == "applied")
        assert parameters(values, "/r/late")["state"] == "waiting"
        nodes.start("/r/a", "2", rate=7.0)
        await wait_until_async(lambda: nodes.nodes["/r/a"]["rate"] == 2.0)
        nodes.start("/r/late", "1", x=0)
        await wait_until_async(lambda: nodes.nodes["/r/late"]["x"] == 1)
        values.want(None, None)
        await wait_until_async(lambda: nodes.nodes["/r/a"]["rate"] == 7.0)
        await wait_until_async(lambda: nodes.nodes["/r/late"]["x"] == 0)


async def test_a_refused_value_is_named_and_not_asked_again() -> None:
    nodes = RosNodes(a={"rate": 1.0, "name": "x"})
    nodes.refuses = {"rate"}
    async with seeing_to(nodes) as values:
        values.want({"a": {"rate": 9.0, "name": "y"}}, None)
        await wait_until_async(lambda: parameters(values)["state"] == "refused")
        assert parameters(values)["refused"] == {"rate": "too much"}
        assert parameters(values)["values"] == {"name": "y"}
        nodes.changed()
        values.want({"a": {"rate": 9.0, "name": "y"}}, None)
        values.want({"a": {"name": "y"}, "b": {}}, None)
        await wait_until_async(lambda: parameters(values)["state"] == "applied")
    assert len(nodes.sets) == 1


async def test_a_node_that_does_not_answer_is_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "RETRY_S", 0.02)
    nodes = RosNodes(a={"rate": 1.0})
    nodes.silent = {"/r/a"}
    async with seeing_to(nodes) as values:
        values.want({"a": {"rate": 2.0}}, None)
        await wait_until_async(lambda: "does not answer" in parameters(values).get("message", ""))
        nodes.silent.clear()
        await wait_until_async(lambda: parameters(values)["state"] == "applied")
    assert "message" not in parameters(values)


async def test_changes_of_the_graph_do_not_hurry_a_node_that_does_not_answer() -> None:
    nodes = RosNodes(a={"rate": 1.0})
    nodes.silent = {"/r/a"}
    asked = 0

    def counted(node: str) -> None:
        nonlocal asked
        asked += 1
        nodes.changed()
        raise UnavailableError(node)

    nodes.answer = counted  # type: ignore[method-assign]
    async with seeing_to(nodes) as values:
        values.want({"a": {"rate": 2.0}}, None)
        await wait_until_async(lambda: asked > 0)
        for _ in range(50):
            nodes.changed()
            await asyncio.sleep(0)
    assert asked == 1


async def test_what_a_node_had_before_is_known_after_a_crash_of_the_agent() -> None:
    nodes, disk = RosNodes(a={"rate": 1.0}), SimDisk(random.Random(1))
    async with seeing_to(nodes, disk) as values:
        values.want({"a": {"rate": 2.0}}, {"a": "active"})
        await wait_until_async(lambda: nodes.states["/r/a"] == "active" and parameters(values)["state"] == "applied")
        values.want({"a": {"rate": 3.0}}, {"a": "active"})
        await wait_until_async(lambda: parameters(values)["values"] == {"rate": 3.0})
    async with seeing_to(nodes, disk) as values:
        values.want(None, None)
        await wait_until_async(lambda: nodes.nodes["/r/a"]["rate"] == 1.0 and nodes.states["/r/a"] == "unconfigured")


async def test_nothing_is_changed_where_what_was_before_cannot_be_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "RETRY_S", 0.02)
    nodes, disk = RosNodes(a={"rate": 1.0}), SimDisk(random.Random(1), size_bytes=10)
    async with seeing_to(nodes, disk) as values:
        values.want({"a": {"rate": 2.0}}, None)
        await wait_until_async(lambda: "message" in parameters(values))
        assert nodes.nodes["/r/a"]["rate"] == 1.0
        disk.repair()
        await wait_until_async(lambda: nodes.nodes["/r/a"]["rate"] == 2.0)


async def test_a_transition_that_a_node_refuses_is_reported_with_where_it_stays() -> None:
    nodes = RosNodes(a={})
    nodes.stuck = {3}
    async with seeing_to(nodes) as values:
        values.want(None, {"a": "active"})
        await wait_until_async(lambda: "message" in values.reported()["lifecycle"]["/r/a"])
        found = values.reported()["lifecycle"]["/r/a"]
    assert (found["state"], found["wanted"]) == ("inactive", "active")
    assert "stays inactive" in found["message"]


async def test_nodes_outside_the_robots_namespace_are_never_asked() -> None:
    nodes = RosNodes()
    nodes.nodes["/other/n"], nodes.life["/other/n"] = {"x": 1}, "1"
    async with seeing_to(nodes) as values:
        values.want({"/other/n": {"x": 2}}, None)
        await wait_until_async(lambda: "outside" in parameters(values, "/other/n").get("message", ""))
    assert not nodes.sets


def test_the_way_through_the_states() -> None:
    for start in ("unconfigured", "inactive", "active"):
        for goal in ("unconfigured", "inactive", "active", "finalized"):
            state, steps = start, 0
            while (step := next_step(state, goal)) is not None:
                state, steps = STEPS[step], steps + 1
            assert state == goal
            assert steps <= 2
    assert next_step("finalized", "active") is None
    assert next_step("activating", "active") is None
    assert next_step("unknown", "active") is None


def test_a_damaged_file_of_what_was_before_is_as_none() -> None:
    disk = SimDisk(random.Random(1))
    for data in (b"[1]", b"{", b'{"/a": 3}', b'{"/a": {"life": "1"}}'):
        disk.files["twin/originals.json"] = data
        assert InitialValues(disk).nodes == {}


async def test_too_much_of_it_is_refused() -> None:
    initial_values = InitialValues(SimDisk(random.Random(1)))
    initial_values.of("/r/a", "1").parameters = {"text": "x" * (1 << 20)}
    with pytest.raises(DiskError):
        await initial_values.keep()


@pytest.mark.parametrize(("reached", "start"), [(True, 1.0), (False, 7.0)])
async def test_a_node_that_starts_again_under_our_hands_gets_back_the_values_of_its_start(
    reached: bool, start: float
) -> None:
    """It is asked in one life, and what is set of it comes to the next one, or still to the first."""
    nodes = RosNodes(a={"rate": 1.0})
    real = nodes.set

    async def restarted(node: str, values: Mapping[str, Any]) -> Mapping[str, SetResult]:
        nodes.set = real  # type: ignore[method-assign]
        if reached:
            nodes.start(node, "2", rate=start)
        results = await real(node, values)
        if not reached:
            nodes.start(node, "2", rate=start)
        return results

    nodes.set = restarted  # type: ignore[method-assign]
    async with seeing_to(nodes) as values:
        values.want({"a": {"rate": 2.0}}, None)
        await wait_until_async(lambda: parameters(values)["state"] == "applied" and nodes.nodes["/r/a"]["rate"] == 2.0)
        values.want(None, None)
        await wait_until_async(lambda: nodes.nodes["/r/a"]["rate"] == start)
