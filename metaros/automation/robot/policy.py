"""The robot's own policy for functions, set by the agent that runs beside them, and by nothing remote.

The agent puts it into the environment of the nodes that its supervisor starts; its settings are a file on the robot.
Without an agent nothing that moves the robot is allowed.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from metaros.errors import ConfigError, MetarosError
from metaros.idl.globs import Glob
from metaros.wire.profile import ACTUATORS

__all__ = ["ACTUATORS_VARIABLE", "ALLOWED_VARIABLE", "FOLDER_VARIABLE", "ROBOT_VARIABLE", "FunctionPolicy"]

ROBOT_VARIABLE: Final = "METAROS_ROBOT"  # the robot's id
FOLDER_VARIABLE: Final = "METAROS_FUNCTIONS_DIR"  # where functions keep their state
ACTUATORS_VARIABLE: Final = "METAROS_ACTUATORS"  # JSON: globs of what moves the robot
ALLOWED_VARIABLE: Final = "METAROS_FUNCTION_ACTUATORS"  # JSON: globs of those that functions may use all the same


@dataclass(frozen=True, slots=True)
class FunctionPolicy:
    """Names are full ones. What is outside of `namespace` is another robot's."""

    namespace: str
    actuators: tuple[Glob, ...] = tuple(Glob(pattern) for pattern in ACTUATORS)
    allowed: tuple[Glob, ...] = ()

    @classmethod
    def of(cls, environ: Mapping[str, str], *, namespace: str) -> FunctionPolicy:
        """From the environment. ConfigError for what is no list of patterns."""
        known = _globs(environ, ACTUATORS_VARIABLE)
        allowed = _globs(environ, ALLOWED_VARIABLE) or ()
        return cls(namespace, allowed=allowed) if known is None else cls(namespace, known, allowed)

    def objection(self, name: str) -> str:
        """Why a topic or service is not for functions; "" where it is."""
        prefix = self.namespace.rstrip("/") + "/"
        if not name.startswith(prefix):
            return f"{name} is outside of this robot's namespace {self.namespace}"
        if any(glob.matches(name) for glob in self.actuators) and not any(glob.matches(name) for glob in self.allowed):
            return f"{name} moves the robot: its own settings ([nodes] function_actuators) would have to allow it"
        return ""


def _globs(environ: Mapping[str, str], variable: str) -> tuple[Glob, ...] | None:
    text = environ.get(variable)
    if text is None:
        return None
    try:
        found = json.loads(text)
        if not isinstance(found, list):
            raise ConfigError(f"{variable}: a JSON list of patterns")
        return tuple(Glob(pattern) for pattern in found)
    except (ValueError, MetarosError) as error:
        raise ConfigError(f"{variable}: {error}") from error
