"""The path prefix of the Lambda API."""

from __future__ import annotations

__all__ = ["LINKS", "PREFIX", "is_lambda"]

PREFIX = "/lambda"
LINKS = f"{PREFIX}/code/"  # what carries a token of its own


def is_lambda(path: str) -> bool:
    """Whether a path is the Lambda API's."""
    return path == PREFIX or path.startswith(f"{PREFIX}/")
