"""The path of incoming webhooks."""

from __future__ import annotations

from starlette.types import Scope

__all__ = ["PREFIX", "is_webhook"]

PREFIX = "/api/v1/hooks/"


def is_webhook(scope: Scope) -> bool:
    """Whether a request brings a webhook: its hook alone authenticates who sends it."""
    path: str = scope["path"]
    if scope["type"] != "http" or scope.get("method") != "POST" or not path.startswith(PREFIX):
        return False
    return "/" not in path.removeprefix(PREFIX)
