"""Leases on their way to the supervisor, without one."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from edge_agent.link.frames import ControlFrame
from edge_agent.nodes.errors import SupervisorError
from edge_agent.nodes.link_handler import NodeLinkHandler
from metaros._proto import link_pb2


class Manager:
    """Has no supervisor for the first leases, and then one."""

    def __init__(self) -> None:
        self.given: list[tuple[list[str], float]] = []
        self.asked = asyncio.Event()

    async def run(self) -> None:
        await asyncio.Event().wait()

    async def leases(self, given: list[link_pb2.NodeLease], *, at_s: float) -> None:
        self.given.append(([lease.node for lease in given], at_s))
        self.asked.set()
        if len(self.given) == 1:
            raise SupervisorError("the supervisor does not answer")


async def test_leases_that_the_supervisor_did_not_get_are_reported_and_the_next_are_handed_over(
    caplog: pytest.LogCaptureFixture,
) -> None:
    manager: Any = Manager()
    link = NodeLinkHandler(manager, lease_s=lambda: 5.0)
    reported: list[link_pb2.AgentFrame] = []
    link.link_up(reported.append, link_pb2.Welcome())
    running = asyncio.create_task(link.run())

    def lease(*nodes: str, since_ns: int) -> None:
        frame = link_pb2.NodeLeases(leases=[link_pb2.NodeLease(node=node) for node in nodes], since_ns=since_ns)
        link.take(ControlFrame(link_pb2.GatewayFrame(node_leases=frame), 0.0))

    lease(since_ns=0)
    since_ns = reported[-1].leases_taken.boot_ns
    for nodes in (["dock"], ["dock", "map"]):
        manager.asked.clear()
        lease(*nodes, since_ns=since_ns)
        await asyncio.wait_for(manager.asked.wait(), 60)
    assert manager.given == [(["dock"], since_ns / 1e9), (["dock", "map"], since_ns / 1e9)]
    assert [record.message for record in caplog.records] == ["leases: the supervisor does not answer"]
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
