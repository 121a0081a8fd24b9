"""Bodies and answers of the update files' routes."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

__all__ = ["Bundle", "OnlineKeys", "OnlineKeysRequest", "Published", "SignedUpload", "UpdateList", "WithdrawRequest"]


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Bundle(_Model):
    """An uploaded bundle; robots can have it once it is `signed`, and until it is `withdrawn`."""

    path: str
    kind: Literal["node", "agent"]
    name: str
    version: str
    min_version: str
    hw: list[str]
    python: str
    sha256: str
    size_bytes: int
    signed: bool
    uploaded: str
    uploaded_by: str
    withdrawn: str | None
    reason: str


class SignedRole(_Model):
    """The newest signed document of a role."""

    role: str
    version: int
    expires: str
    online: bool


class UpdateList(_Model):
    """What robots can be given; `trouble`: why this gateway cannot sign again what ends soon, "" if it can."""

    roles: list[SignedRole]
    bundles: list[Bundle]
    trouble: str


class OnlineKeysRequest(_Model):
    """`fresh`: make new ones, for the next root."""

    fresh: bool = False


class OnlineKeys(_Model):
    """The public keys of the gateway's roles, as an offline folder takes them."""

    keys: dict[str, dict[str, object]]


class SignedUpload(_Model):
    """Signed documents as they were written, to be published together."""

    roots: list[str] = Field(default_factory=list, max_length=64)
    targets: str | None = None
    groups: dict[str, str] = Field(default_factory=dict, max_length=31)


class Published(_Model):
    """The newest version of each role."""

    roles: dict[str, int]


class WithdrawRequest(_Model):
    """Hand this version out no more."""

    path: str = Field(max_length=255)
    reason: str = Field(default="", max_length=500)
