"""The agent's Zenoh session: of the profile that the settings name."""

from __future__ import annotations

import os
from collections.abc import Mapping

from edge_agent.config import Settings
from metaros.wire.profile import default_folder, session_file

__all__ = ["session_environ"]


def session_environ(settings: Settings) -> Mapping[str, str]:
    """The environment that its session is opened in: in the protected profile it is the user `agent`.

    Raises ConfigError where the router has not made the agent's session file.
    """
    if settings.zenoh_profile == "open":
        return os.environ
    path = session_file(settings.zenoh_credentials or default_folder(), "agent")
    return {**os.environ, "ZENOH_SESSION_CONFIG_URI": str(path)}
