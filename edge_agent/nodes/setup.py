"""Builds an agent's node manager from its settings."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from edge_agent.nodes.bundles import Bundles
from edge_agent.nodes.launch_row import LaunchContext
from edge_agent.nodes.launcher import python_of_base
from edge_agent.nodes.ledger import Ledger
from edge_agent.nodes.link_handler import NodeLinkHandler
from edge_agent.nodes.manager import NodeManager
from metaros.automation.robot.policy import ACTUATORS_VARIABLE, ALLOWED_VARIABLE, FOLDER_VARIABLE, ROBOT_VARIABLE
from metaros.clock import Clock
from metaros.wire.profile import default_folder

if TYPE_CHECKING:
    from edge_agent.config.settings import Settings

__all__ = ["open_nodes"]


def open_nodes(
    settings: Settings, directory: Path, clock: Clock, *, domain: int, bundles: Bundles | None
) -> NodeLinkHandler:
    """The manager's link handler; nothing runs before its `run` does. Without `bundles` the robot is not enrolled."""
    session = _folder(settings, enrolled=bundles is not None)
    place = LaunchContext(
        namespace=settings.namespace,
        zenoh_port=settings.zenoh_port,
        domain=domain,
        python=python_of_base(),
        env={
            **({"ZENOH_SESSION_CONFIG_URI": str(session / "node.json5")} if session else {}),
            ROBOT_VARIABLE: settings.name,
            FOLDER_VARIABLE: str(directory / "functions"),
            ACTUATORS_VARIABLE: json.dumps(settings.actuators),
            ALLOWED_VARIABLE: json.dumps(settings.nodes.function_actuators),
        },
        drive_session=str(session / "agent.json5") if session else "",
    )
    manager = NodeManager(
        Ledger(directory),
        settings=settings.nodes,
        place=place,
        clock=clock,
        bundles=bundles,
    )
    return NodeLinkHandler(manager)


def _folder(settings: Settings, *, enrolled: bool) -> Path | None:
    """Of the session files, where the router is protected: nodes come as the user `node`, who drives nothing."""
    folder = settings.zenoh_credentials or default_folder()
    profile = settings.zenoh_profile
    if profile == "open" or (profile == "auto" and not (enrolled and (folder / "agent.json5").is_file())):
        return None
    return folder
