"""Applies a twin document to the robot: nodes, topics, budget, parameters, lifecycle, agent.

Nodes come first: they alone can say no, and then nothing has changed. A section that is absent is as the robot's own
settings have it.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from edge_agent.config.topic_table import TopicTable
from edge_agent.forwarding.channels import Channels
from edge_agent.link.byte_budget_override import UplinkLimit
from edge_agent.twin.node_reconciler import NodeReconciler
from edge_agent.twin.targets import AgentVersion, NodeTable
from edge_agent.twin.topic_table import TwinTopicTable
from metaros.errors import MetarosError
from metaros.fleet.twin import Twin, parse

__all__ = ["Applier", "table_of"]

LOG = logging.getLogger("metaros.agent.twin")


def table_of(own: TopicTable, twin: Twin, *, namespace: str) -> TopicTable:
    """The topic table under a twin. Raises NameError_ for a pattern that is too long."""
    return own if twin.topics is None else TwinTopicTable(own, twin.topics, namespace=namespace)


class Applier:
    """Hands the document's sections to the agent's parts. On the event loop."""

    def __init__(
        self,
        own: TopicTable,
        *,
        namespace: str,
        channels: Channels,
        look_again: Callable[[], None],
        limit: UplinkLimit,
        values: NodeReconciler,
        nodes: NodeTable,
        agent: AgentVersion,
    ) -> None:
        """`look_again` lets the tap send each topic to the channel that it has now."""
        self._own = own
        self._namespace = namespace
        self._channels = channels
        self._look_again = look_again
        self._limit = limit
        self._values = values
        self._nodes = nodes
        self._agent = agent
        self._kept: list[str] = []  # topics that stay in their class
        self._troubles: dict[str, str] = {}  # by section

    def check(self, document: bytes) -> Twin:
        """The parsed document, if it can be applied as far as is known beforehand. Raises UsageError."""
        twin = parse(document)
        table_of(self._own, twin, namespace=self._namespace)
        return twin

    async def apply(self, document: bytes, *, trial: bool, known: bool = True) -> None:
        """From now on. On trial a refusal is raised before anything changed; else as much is done as can be.

        Where no twin is `known` yet, or none any more, nodes that run go on.

        Raises:
            MetarosError: on trial, what the robot's own settings do not let it run.
        """
        twin = self.check(document)
        self._troubles.clear()
        try:
            if known:
                await self._nodes.set_nodes(twin.nodes)
        except MetarosError as error:
            if trial:
                raise
            LOG.error("the twin's nodes: %s", error)
            self._troubles["nodes"] = str(error)
        self._kept = self._channels.use(table_of(self._own, twin, namespace=self._namespace))
        self._look_again()
        self._limit.rule(twin.budget_bytes_per_s)
        self._values.want(twin.parameters, twin.lifecycle)
        await self._agent.want(twin.agent_version or None)

    @property
    def handed_over(self) -> bool:
        """Whether all that begins later has begun, or cannot now: nodes, which can starve the link when they run."""
        return self._nodes.handed_over

    def reported(self) -> dict[str, Any]:
        """What is really so."""
        report = {
            "agent": self._agent.reported(),
            "nodes": self._nodes.reported(),
            **self._values.reported(),
            "budget": {"bytes_per_s": self._limit.bytes_per_s},
        }
        if self._kept:
            self._troubles["topics"] = (
                f"the table of channels is full: {', '.join(self._kept)[:1000]} stay in their class"
            )
        if self._troubles:
            report["troubles"] = dict(self._troubles)
        return report
