"""`rclpy.topic_or_service_is_hidden`: what tools leave out unless asked."""

from __future__ import annotations

from typing import Final

__all__ = ["HIDDEN_TOPIC_PREFIX", "TOPIC_SEPARATOR_STRING", "topic_or_service_is_hidden"]

HIDDEN_TOPIC_PREFIX: Final = "_"
TOPIC_SEPARATOR_STRING: Final = "/"


def topic_or_service_is_hidden(name: str) -> bool:
    """Whether any token of the name starts with an underscore."""
    return any(token.startswith(HIDDEN_TOPIC_PREFIX) for token in name.split(TOPIC_SEPARATOR_STRING))
