"""Accounts, keys, tickets and sign-in in the API's documents: what a request may hold and what answers it."""

from __future__ import annotations

from typing import Literal

from pydantic import ConfigDict, Field

from gateway.api.models.base import Exact
from metaros.limits import LIMITS

__all__ = [
    "Account",
    "ApiKey",
    "ApiKeyList",
    "ApiKeyRequest",
    "LinkRequest",
    "LoginRequest",
    "NewApiKey",
    "Nothing",
    "PasswordRequest",
    "Provider",
    "SignInLink",
    "Ticket",
    "TicketRequest",
    "TokenRequest",
    "User",
    "UserChange",
    "UserList",
    "UserRequest",
]

RoleWord = Literal["viewer", "operator", "admin"]


class Nothing(Exact):
    """An empty object."""


class LoginRequest(Exact):
    """A name and its password."""

    name: str = Field(max_length=64)
    password: str = Field(max_length=LIMITS.password_chars)


class TokenRequest(Exact):
    """What stands behind the # of a sign-in link."""

    token: str = Field(max_length=128)


class LinkRequest(Exact):
    """For whom; "" is the first administrator, who is made where there is none."""

    name: str = Field(default="", max_length=64)


class PasswordRequest(Exact):
    """`old` is "" for who has no password yet."""

    old: str = Field(default="", max_length=LIMITS.password_chars)
    new: str = Field(max_length=LIMITS.password_chars)


class Account(Exact):
    """Who asks, and what they may do. `csrf` goes into X-CSRF-Token; "" where no cookie is used.

    `has_password`: whether they can sign in by a password; one who cannot may set the first without an old one.
    """

    kind: Literal["anonymous", "user", "key", "robot"]
    id: str
    name: str
    role: Literal["none", "viewer", "operator", "admin"]
    robots: list[str]
    scopes: list[str]
    csrf: str
    has_password: bool
    permissions: list[str]


class SignInLink(Exact):
    """A link that signs `user` in once; nobody can look it up again."""

    user: str
    url: str
    token: str
    expires: str


class UserRequest(Exact):
    """A new user; without a password they sign in by a link."""

    name: str = Field(max_length=64)
    role: RoleWord
    robots: list[str] = Field(default=["*"], max_length=LIMITS.robot_patterns)
    password: str = Field(default="", max_length=LIMITS.password_chars)


class UserChange(Exact):
    """What is to change; what is left out stays."""

    role: RoleWord | None = None
    robots: list[str] | None = Field(default=None, max_length=LIMITS.robot_patterns)
    disabled: bool | None = None
    password: str | None = Field(default=None, max_length=LIMITS.password_chars)


class User(Exact):
    """A user; `external`: they sign in elsewhere."""

    id: str
    name: str
    role: RoleWord
    robots: list[str]
    disabled: bool
    has_password: bool
    external: bool
    created: str
    signed_in: str | None


class UserList(Exact):
    """Everybody, by name."""

    users: list[User]
    next: str | None


class ApiKeyRequest(Exact):
    """A new key; `expires_s` null: it never expires."""

    name: str = Field(max_length=64)
    role: RoleWord
    robots: list[str] = Field(default=["*"], max_length=LIMITS.robot_patterns)
    scopes: list[str] = Field(default=[], max_length=8)
    expires_s: float | None = Field(default=None, ge=1, le=LIMITS.key_life_s)


class ApiKey(Exact):
    """A key without its secret; `user` is "" for a key of nobody's. `used` is exact to five minutes."""

    id: str
    name: str
    user: str
    role: RoleWord
    robots: list[str]
    scopes: list[str]
    created: str
    expires: str | None
    used: str | None


class NewApiKey(ApiKey):
    """A new key. `key` is what goes behind "Authorization: Bearer"; it and `secret` are told this once."""

    secret: str
    key: str


class ApiKeyList(Exact):
    """The newest first."""

    keys: list[ApiKey]
    next: str | None


class TicketRequest(Exact):
    """What the ticket may do at most; without robots, all that its maker sees."""

    model_config = ConfigDict(json_schema_extra={"example": {"robots": ["r1"], "ttl_s": 3600.0}})

    robots: list[str] | None = Field(default=None, min_length=1, max_length=LIMITS.robot_patterns)
    role: RoleWord = "viewer"
    ttl_s: float = Field(default=3600.0, ge=1.0, le=LIMITS.ticket_s, description="how long it is good, seconds")


class Ticket(Exact):
    """A bearer for viewers' sockets: `ws://…/foxglove?token=TICKET`."""

    model_config = ConfigDict(json_schema_extra={"example": {"ticket": "mrt_…", "expires": "2026-11-22T12:00:00Z"}})

    ticket: str
    expires: str


class Provider(Exact):
    """What the sign-in page offers; nulls where there is no provider."""

    name: str | None
    url: str | None
