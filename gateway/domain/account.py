"""Accounts as they are stored: users, their sessions, and API keys. The secrets themselves are in none of them."""

from __future__ import annotations

from dataclasses import dataclass, field

from gateway.domain.principal import EVERY_ROBOT, Role

__all__ = ["LAMBDA", "SCOPES", "ApiKey", "Session", "User"]

LAMBDA = "lambda"  # may sign requests to the functions' API, whose signatures need the secret itself
SCOPES = (LAMBDA,)


@dataclass(frozen=True, slots=True, kw_only=True)
class User:
    """A person. `password` is a hash, "" where they sign in by a link or elsewhere; `external` says where."""

    id: str
    name: str
    role: Role
    robots: tuple[str, ...] = EVERY_ROBOT
    password: str = field(default="", repr=False)
    external: str | None = None
    disabled: bool = False
    created_ns: int = 0
    signed_in_ns: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Session:
    """A browser that is signed in; `id` is the SHA-256 of its cookie, hexadecimal."""

    id: str
    user_id: str
    created_ns: int
    seen_ns: int
    expires_ns: int
    address: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ApiKey:
    """A program's key. `user_id` None: nobody's, made on the gateway's machine; `expires_ns` 0: never."""

    id: str
    name: str
    user_id: str | None
    role: Role
    robots: tuple[str, ...] = EVERY_ROBOT
    scopes: frozenset[str] = frozenset()
    secret_hash: str = field(default="", repr=False)
    sealed: bytes | None = field(default=None, repr=False)
    created_ns: int = 0
    expires_ns: int = 0
    used_ns: int = 0
