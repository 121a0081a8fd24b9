"""A robot's node beside the function."""

from __future__ import annotations

from tests.edge_agent.conftest import Robot, robot

__all__ = ["Robot", "robot"]
