"""What launch files borrow from launch itself."""

from __future__ import annotations

from metaros.ros2.launch.substitution import normalize_to_list_of_substitutions, perform_substitutions

__all__ = ["normalize_to_list_of_substitutions", "perform_substitutions"]
