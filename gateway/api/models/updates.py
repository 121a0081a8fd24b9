"""Bodies and answers of the update files' routes."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from gateway.api.models.base import Exact

__all__ = ["Bundle", "OnlineKeys", "OnlineKeysRequest", "Published", "SignedUpload", "UpdateList", "WithdrawRequest"]


class Bundle(Exact):
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


class SignedRole(Exact):
    """The newest signed document of a role."""

    role: str
    version: int
    expires: str
    online: bool


class UpdateList(Exact):
    """What robots can be given; `trouble`: why this gateway cannot sign again what ends soon, "" if it can."""

    roles: list[SignedRole]
    bundles: list[Bundle]
    trouble: str


class OnlineKeysRequest(Exact):
    """`fresh`: make new ones, for the next root."""

    fresh: bool = False


class OnlineKeys(Exact):
    """The public keys of the gateway's roles, as an offline folder takes them."""

    keys: dict[str, dict[str, object]]


class SignedUpload(Exact):
    """Signed documents as they were written, to be published together."""

    roots: list[str] = Field(default_factory=list, max_length=64)
    targets: str | None = None
    groups: dict[str, str] = Field(default_factory=dict, max_length=31)


class Published(Exact):
    """The newest version of each role."""

    roles: dict[str, int]


class WithdrawRequest(Exact):
    """Hand this version out no more."""

    path: str = Field(max_length=255)
    reason: str = Field(default="", max_length=500)
