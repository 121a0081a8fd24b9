"""Environment variables of ROS 2: those a sourced installation sets, and those that mean nothing here.

`ROS_DOMAIN_ID`, `AMENT_PREFIX_PATH`, `ZENOH_SESSION_CONFIG_URI`, `ZENOH_CONFIG_OVERRIDE` and `RCUTILS_*` are read where
they are used. `ROS_LOG_DIR` and `ROS_HOME` say where rcl keeps log files; here output goes where the process's does.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from typing import Final

__all__ = ["DEFAULTS", "ignored_settings", "set_defaults"]

DEFAULTS: Final = {"ROS_VERSION": "2", "ROS_PYTHON_VERSION": "3", "ROS_DISTRO": "jazzy"}
_RMW: Final = "rmw_zenoh_cpp"


def set_defaults() -> None:
    """What programs ask for after `source setup.bash`; what is set stays."""
    for name, value in DEFAULTS.items():
        os.environ.setdefault(name, value)


def ignored_settings(environ: Mapping[str, str]) -> Iterator[str]:
    """A line for each variable that is set to something else than what happens here."""
    rmw = environ.get("RMW_IMPLEMENTATION", "")
    if rmw not in ("", _RMW):
        yield f"RMW_IMPLEMENTATION={rmw} has no effect: nodes here speak {_RMW}'s protocol"
    reach = environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "")
    if reach.upper() not in ("", "SUBNET", "SYSTEM_DEFAULT", "LOCALHOST"):
        yield f"ROS_AUTOMATIC_DISCOVERY_RANGE={reach} has no effect: nodes meet at the Zenoh router they connect to"
    if environ.get("ROS_STATIC_PEERS"):
        yield "ROS_STATIC_PEERS has no effect: name routers in METAROS_ZENOH_PORT or ZENOH_CONFIG_OVERRIDE"
