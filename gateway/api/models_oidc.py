"""The documents of signing in elsewhere, as models."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict

__all__ = ["Provider"]


class Provider(BaseModel):
    """What the sign-in page offers; nulls where there is no provider."""

    model_config = ConfigDict(extra="forbid")

    name: str | None
    url: str | None
