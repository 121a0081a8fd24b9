"""The agent's Zenoh session: of the profile that the settings name, or that the robot has."""

from __future__ import annotations

import logging
import os
from collections.abc import Mapping

from edge_agent.config.settings import Settings
from metaros.wire.profile import default_folder, session_file

__all__ = ["session_environ"]

LOG = logging.getLogger("metaros.agent.zenoh")


def session_environ(settings: Settings, *, enrolled: bool) -> Mapping[str, str]:
    """The environment that its session is opened in: in the protected profile it is the user `agent`.

    Nobody but the router can protect a robot, and it locks out every node that has no password. So an enrolled robot
    whose router is open is not turned away, but told; and one that was protected is never quietly so no more: a session
    with a password does not open on a router that is open.

    Raises ConfigError where the router has not made the agent's session file.
    """
    folder = settings.zenoh_credentials or default_folder()
    profile = settings.zenoh_profile
    if profile == "auto":
        profile = "protected" if enrolled and (folder / "agent.json5").is_file() else "open"
        if profile == "protected":
            LOG.info("the Zenoh session is that of %s; --zenoh-profile open for an open router", folder)
        elif enrolled:
            LOG.warning(
                "any process on this machine can drive this enrolled robot: metaros router --zenoh-profile protected"
            )
    if profile == "open":
        return os.environ
    return {**os.environ, "ZENOH_SESSION_CONFIG_URI": str(session_file(folder, "agent"))}
