"""The nodes' desk of an agent, from its settings."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from edge_agent.nodes.bundles import Bundles
from edge_agent.nodes.desk import NodeDesk
from edge_agent.nodes.launcher import python_of_base
from edge_agent.nodes.ledger import Ledger
from edge_agent.nodes.link import NodeLink
from edge_agent.nodes.rows import Place
from metaros.clock import Clock
from metaros.robot_functions.law import ACTUATORS_VARIABLE, ALLOWED_VARIABLE, FOLDER_VARIABLE, ROBOT_VARIABLE
from metaros.wire.profile import default_folder

if TYPE_CHECKING:
    from edge_agent.config import Settings

__all__ = ["open_nodes"]


def open_nodes(settings: Settings, directory: Path, clock: Clock, *, domain: int, bundles: Bundles | None) -> NodeLink:
    """The desk on the link; nothing runs before its `run` does. Without `bundles` the robot is not enrolled."""
    session = _folder(settings, enrolled=bundles is not None)
    place = Place(
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
    desk = NodeDesk(
        Ledger(directory),
        settings=settings.nodes,
        place=place,
        clock=clock,
        bundles=bundles,
    )
    return NodeLink(desk)


def _folder(settings: Settings, *, enrolled: bool) -> Path | None:
    """Of the session files, where the router is protected: nodes come as the user `node`, who drives nothing."""
    folder = settings.zenoh_credentials or default_folder()
    profile = settings.zenoh_profile
    if profile == "open" or (profile == "auto" and not (enrolled and (folder / "agent.json5").is_file())):
        return None
    return folder
