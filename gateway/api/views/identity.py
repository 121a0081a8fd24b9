"""Accounts as the API shows them: never a hash, never a secret but a new one."""

from __future__ import annotations

from typing import Any

from gateway.api.views.robots import rfc3339
from gateway.domain.account import ApiKey, User
from gateway.domain.principal import Principal
from gateway.identity.keys import NewKey
from gateway.identity.permissions import PERMISSIONS

__all__ = ["account_view", "key_view", "new_key_view", "user_view"]


def account_view(principal: Principal, *, has_password: bool) -> dict[str, Any]:
    """Who asks, and what they may do."""
    return {
        "kind": principal.kind,
        "id": principal.id,
        "name": principal.name,
        "role": principal.role.word,
        "robots": list(principal.robots),
        "scopes": sorted(principal.scopes),
        "csrf": principal.csrf,
        "has_password": has_password,
        "permissions": [row.name for row in PERMISSIONS if row.who == "people" and row.granted(principal)],
    }


def user_view(user: User) -> dict[str, Any]:
    """A user."""
    return {
        "id": user.id,
        "name": user.name,
        "role": user.role.word,
        "robots": list(user.robots),
        "disabled": user.disabled,
        "has_password": bool(user.password),
        "external": user.external is not None,
        "created": rfc3339(user.created_ns),
        "signed_in": rfc3339(user.signed_in_ns) if user.signed_in_ns else None,
    }


def key_view(key: ApiKey, owner: str) -> dict[str, Any]:
    """A key, and whose it is."""
    return {
        "id": key.id,
        "name": key.name,
        "user": owner,
        "role": key.role.word,
        "robots": list(key.robots),
        "scopes": sorted(key.scopes),
        "created": rfc3339(key.created_ns),
        "expires": rfc3339(key.expires_ns) if key.expires_ns else None,
        "used": rfc3339(key.used_ns) if key.used_ns else None,
    }


def new_key_view(made: NewKey, owner: str) -> dict[str, Any]:
    """A new key with its secret."""
    return {**key_view(made.key, owner), "secret": made.secret, "key": made.text}
