"""The twin of an agent, from its state directory and its parts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from edge_agent.outbox import Disk
from edge_agent.scope import Scope
from edge_agent.topics import TopicTable
from edge_agent.twin.apply import Applier, table_of
from edge_agent.twin.confirm import Action, Confirm
from edge_agent.twin.desk import TwinDesk
from edge_agent.twin.originals import Originals
from edge_agent.twin.parts import AgentVersion, NodeTable
from edge_agent.twin.services import NodeServices
from edge_agent.twin.state import TwinFile
from edge_agent.twin.values import NodeValues
from edge_agent.uplink_limit import UplinkLimit
from metaros.clock import Clock
from metaros.errors import UsageError
from metaros.limits import LIMITS, Limits
from metaros.twin import Twin, parse

if TYPE_CHECKING:
    from edge_agent.channels import Channels

__all__ = ["TwinStart", "open_twin"]


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinStart:
    """What the robot is to live by when its agent begins, before there is any part to tell."""

    confirm: Confirm
    file: TwinFile
    actions: list[Action]
    own: TopicTable
    table: TopicTable
    namespace: str
    originals: Originals
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
    ) -> tuple[TwinDesk, NodeValues]:
        """The desk, and what sees to other nodes; both are to be run."""
        values = NodeValues(services, scope, self.originals)
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
        desk = TwinDesk(self.confirm, self.file, applier, clock, limits=self.limits)
        values.changed = nodes.changed = agent.changed = desk.stir
        return desk, values


def open_twin(
    disk: Disk, own: TopicTable, clock: Clock, *, namespace: str, boot_id: str, limits: Limits = LIMITS
) -> TwinStart:
    """Read what was kept; what is on trial too long is taken back here. Raises DiskError."""
    file = TwinFile(disk)

    def check(document: bytes) -> Twin:
        twin = parse(document)
        table_of(own, twin, namespace=namespace)
        return twin

    confirm = Confirm(file.load(), clock, boot_id=boot_id, limits=limits, check=check)
    actions = confirm.start()
    try:
        table = table_of(own, check(confirm.lives_by.document), namespace=namespace)
    except UsageError:
        table = own
    return TwinStart(
        confirm=confirm,
        file=file,
        actions=actions,
        own=own,
        table=table,
        namespace=namespace,
        originals=Originals(disk),
        limits=limits,
    )
