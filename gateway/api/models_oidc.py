"""The documents of signing in elsewhere, as models."""

from __future__ import annotations

from gateway.api.model_base import Exact

__all__ = ["Provider"]


class Provider(Exact):
    """What the sign-in page offers; nulls where there is no provider."""

    name: str | None
    url: str | None
