"""The errors of the robot's nodes.

CommandError (edge_agent.errors)
├── NodeRefusedError      this robot's own settings do not let it run        node_not_allowed
└── SupervisorError       the supervisor does not answer, or said no         supervisor
"""

from __future__ import annotations

from edge_agent.errors import CommandError

__all__ = ["NodeRefusedError", "SupervisorError"]


class NodeRefusedError(CommandError):
    """The robot's own settings do not let this run here; the message says which and how to allow it."""

    code = "node_not_allowed"


class SupervisorError(CommandError):
    """The supervisor of this robot does not answer, or refused."""

    code = "supervisor"
