"""What a node tells of itself: type descriptions and logger levels, by ROS 2's standard services."""

from metaros.node.introspection.fetch import fetch_type, fetch_type_async, users_of
from metaros.node.introspection.logger_levels import offer_logger_levels
from metaros.node.introspection.type_description import offer_type_description

__all__ = ["fetch_type", "fetch_type_async", "offer_logger_levels", "offer_type_description", "users_of"]
