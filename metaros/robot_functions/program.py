"""The entry of signed bundles; whatever becomes of the code behind it, those bundles say this name."""

from __future__ import annotations

from metaros.automation.robot.program import bundled

__all__ = ["bundled"]
