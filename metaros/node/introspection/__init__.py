"""What a node tells of itself: type descriptions and logger levels, by ROS 2's standard services."""

from metaros.node.introspection.logger_levels import offer_logger_levels
from metaros.node.introspection.type_description import offer_type_description

__all__ = ["offer_logger_levels", "offer_type_description"]
