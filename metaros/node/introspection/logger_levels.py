"""`~/get_logger_levels` and `~/set_logger_levels`: the node's log level, read and changed remotely."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from metaros.node.core import NodeCore
from metaros.node.logger import LEVELS, Logger
from metaros.node.standard_services import StandardService, serve
from metaros.wire import qos_services

__all__ = ["SERVICES", "offer_logger_levels"]

SERVICES: Final = (
    StandardService(
        "get_logger_levels",
        "rcl_interfaces/srv/GetLoggerLevels",
        "RIHS01_03bf1bebd0d6514c7ed0ba7c5e08dc9f2f39c759fe99e1e30ea4157d7674f72d",
    ),
    StandardService(
        "set_logger_levels",
        "rcl_interfaces/srv/SetLoggerLevels",
        "RIHS01_3ff86cb4e91fbf9abae15c234ecc874448de6ece8e193401c077cf116e4f6d78",
    ),
)
_UNKNOWN: Final = 0
_NAMES: Final = {number: name for name, number in LEVELS.items()}


def offer_logger_levels(node: NodeCore) -> None:
    """Serve the level of the node's own logger, by its name."""
    logger = node.get_logger()
    callbacks: Mapping[str, Callable[[Any, Any], None]] = {
        "get_logger_levels": lambda request, response: _get(logger, request, response),
        "set_logger_levels": lambda request, response: _set(logger, request, response),
    }
    for service in SERVICES:
        serve(node, service, callbacks[service.name], qos_services)


def _get(logger: Logger, request: Any, response: Any) -> None:
    from metaros.interfaces.rcl_interfaces.msg import LoggerLevel

    for name in request.names:
        level = logger.level if name == logger.name else _UNKNOWN
        response.levels.append(LoggerLevel(name=name, level=level))


def _set(logger: Logger, request: Any, response: Any) -> None:
    from metaros.interfaces.rcl_interfaces.msg import SetLoggerLevelsResult

    for wanted in request.levels:
        level = wanted.level or LEVELS["INFO"]  # 0 is ROS's word for the default
        reason = ""
        if wanted.name != logger.name:
            reason = f"no logger {wanted.name[:80]!r} here, only {logger.name!r}"
        elif level not in _NAMES:
            reason = f"{level} is no level: one of {', '.join(map(str, _NAMES))}"
        else:
            logger.set_level(_NAMES[level])
        response.results.append(SetLoggerLevelsResult(successful=not reason, reason=reason))
