"""The twin of an agent, from its state directory and its parts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from edge_agent.config.topic_table import TopicTable
from edge_agent.forwarding.scope import Scope
from edge_agent.link.byte_budget_override import UplinkLimit
from edge_agent.outbox import Disk
from edge_agent.twin.apply import Applier, table_of
from edge_agent.twin.confirm import Action, CommitConfirm
from edge_agent.twin.initial_values import InitialValues
from edge_agent.twin.manager import TwinManager
from edge_agent.twin.node_reconciler import NodeReconciler
from edge_agent.twin.services import NodeServices
from edge_agent.twin.state import TwinFile
from edge_agent.twin.targets import AgentVersion, NodeTable
from metaros.clock import Clock
from metaros.errors import UsageError
from metaros.fleet.twin import Twin, parse
from metaros.limits import LIMITS, Limits

if TYPE_CHECKING:
    from edge_agent.forwarding.channels import Channels

__all__ = ["TwinStart", "open_twin"]


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinStart:
    """The document in force when the agent starts, before any of its parts exist."""

    confirm: CommitConfirm
    file: TwinFile
    actions: list[Action]
    own: TopicTable
    table: TopicTable
    namespace: str
    initial_values: InitialValues
    limits: Limits

    def build(
        self,
        services: NodeServices,
        scope: Scope,
        clock: Clock,
        *,
        channels: Channels,
        look_again: Callable[[], None],
        limit: UplinkLimit,
        nodes: NodeTable,
        agent: AgentVersion,
    ) -> tuple[TwinManager, NodeReconciler]:
        """The manager, and the reconciler of other nodes; both are to be run."""
        values = NodeReconciler(services, scope, self.initial_values)
        applier = Applier(
            self.own,
            namespace=self.namespace,
            channels=channels,
            look_again=look_again,
            limit=limit,
            values=values,
            nodes=nodes,
            agent=agent,
        )
        manager = TwinManager(self.confirm, self.file, applier, clock, limits=self.limits)
        values.changed = nodes.changed = agent.changed = manager.mark_changed
        return manager, values


def open_twin(
    disk: Disk, own: TopicTable, clock: Clock, *, namespace: str, boot_id: str, limits: Limits = LIMITS
) -> TwinStart:
    """Read what was kept; what is on trial too long is taken back here. Raises DiskError."""
    file = TwinFile(disk)

    def check(document: bytes) -> Twin:
        twin = parse(document)
        table_of(own, twin, namespace=namespace)
        return twin

    confirm = CommitConfirm(file.load(), clock, boot_id=boot_id, limits=limits, check=check)
    actions = confirm.start()
    try:
        table = table_of(own, check(confirm.active_version.document), namespace=namespace)
    except UsageError:
        table = own
    return TwinStart(
        confirm=confirm,
        file=file,
        actions=actions,
        own=own,
        table=table,
        namespace=namespace,
        initial_values=InitialValues(disk),
        limits=limits,
    )
