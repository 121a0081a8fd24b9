"""Updates of one agent, put together: what it updates itself by, and its nodes' bundles."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from edge_agent.config.settings import Settings
from edge_agent.identity.credentials import Credentials
from edge_agent.update.nodes import NodeBundles
from edge_agent.update.restart import RESTART, loader_info
from edge_agent.update.slots import Slots
from edge_agent.update.source import Source
from edge_agent.update.updater import AgentUpdates
from metaros.clock import Clock, system_rng
from metaros.fleet.bundle import BundleError, check_group

__all__ = ["Updates", "open_updates"]


@dataclass(frozen=True, slots=True)
class Updates:
    """Its parts."""

    agent: AgentUpdates
    nodes: NodeBundles
    source: Source | None = field(default=None)


def open_updates(
    settings: Settings, state_dir: Path, credentials: Credentials | None, clock: Clock, *, running: str
) -> Updates:
    """Only an enrolled robot takes updates: it knows whom to ask, and the gateway knows whom it gives them to."""
    source, found = None, loader_info()
    if credentials is not None:
        group = settings.labels.get("group", "")
        source = Source(
            state_dir / "update",
            credentials.identity.url,
            credentials.context,
            clock,
            groups=_groups(group),
        )
    agent = AgentUpdates(
        Slots(state_dir),
        source,
        clock,
        system_rng(),
        loader_info=found,
        running=running,
        restart=lambda: RESTART.ask(found),
    )
    return Updates(agent, NodeBundles(state_dir, lambda: source), source)


def _groups(label: str) -> tuple[str, ...]:
    """The robot's label `group`, where an update role may have that name."""
    try:
        return (check_group(label),)
    except BundleError:
        return ()
