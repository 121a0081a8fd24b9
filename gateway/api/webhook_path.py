"""Where webhooks of others come in."""

from __future__ import annotations

from starlette.types import Scope

__all__ = ["PREFIX", "is_hook"]

PREFIX = "/api/v1/hooks/"


def is_hook(scope: Scope) -> bool:
    """Whether a request brings a webhook: whoever sends it is known to its hook alone."""
    path: str = scope["path"]
    if scope["type"] != "http" or scope.get("method") != "POST" or not path.startswith(PREFIX):
        return False
    return "/" not in path.removeprefix(PREFIX)
