"""The type of what may be a text or a substitution."""

from __future__ import annotations

from metaros.ros2.launch.substitution import SomeSubstitutionsType

__all__ = ["SomeSubstitutionsType"]
