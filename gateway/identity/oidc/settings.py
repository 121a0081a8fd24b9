"""The file that says who signs people in: a JSON object, readable by the gateway's user alone as it holds a secret."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import orjson

from gateway.domain.principal import EVERY_ROBOT, Role, check_robots
from gateway.store.private_dir import others_can_read
from metaros.errors import ConfigError

__all__ = ["OidcSettings"]

FILE_BYTES = 64 * 1024
_REQUIRED = ("issuer", "client_id", "redirect_url", "roles")
_TEXTS = ("issuer", "client_id", "client_secret", "redirect_url", "name", "name_claim", "role_claim")


@dataclass(frozen=True, slots=True, kw_only=True)
class OidcSettings:
    """`roles` says for each of our roles which values of the claim `role_claim` have it; the highest counts."""

    issuer: str
    client_id: str
    redirect_url: str
    roles: dict[str, tuple[str, ...]]
    client_secret: str = field(default="", repr=False)
    name: str = "single sign-on"  # on the sign-in page's button
    name_claim: str = "preferred_username"
    role_claim: str = "groups"
    scopes: tuple[str, ...] = ("openid", "profile", "email")
    robots: tuple[str, ...] = EVERY_ROBOT  # of those who are no admins

    @classmethod
    def load(cls, path: Path) -> OidcSettings:
        """Read the file.

        Raises:
            ConfigError: it cannot be read, others can read it, or something in it does not fit.
        """
        try:
            if others_can_read(path):
                raise ConfigError(f"others can read {path}, which holds a secret\nchmod 600 {path}")
            document = orjson.loads(path.read_bytes()[:FILE_BYTES])
        except OSError as error:
            raise ConfigError(f"--oidc {path}: {error.strerror or error}") from error
        except ValueError as error:
            raise ConfigError(f"--oidc {path}: not JSON: {error}") from error
        try:
            return cls(**_checked(document))
        except (TypeError, ValueError) as error:
            raise ConfigError(f"--oidc {path}: {error}") from error

    def role_of(self, claims: dict[str, Any]) -> Role | None:
        """The highest role that the claims give; None for none."""
        said = claims.get(self.role_claim)
        several = said if isinstance(said, list) else [said]
        values = {item for item in several if isinstance(item, str)}
        given = [Role.of(word) for word, wanted in self.roles.items() if values & set(wanted) or "*" in wanted]
        return max(given, default=None)


def _checked(document: Any) -> dict[str, Any]:
    if not isinstance(document, dict):
        raise ValueError("not a JSON object")
    missing = [name for name in _REQUIRED if not document.get(name)]
    if missing:
        raise ValueError(f"it lacks {', '.join(missing)}")
    for name in _TEXTS:
        if name in document and not isinstance(document[name], str):
            raise ValueError(f"{name} is not a text")
    roles = document["roles"]
    if not isinstance(roles, dict):
        raise ValueError('roles is not an object like {"admin": ["robot-admins"]}')
    kept = {word: _texts(f"roles.{word}", values) for word, values in roles.items()}
    for word in kept:
        Role.of(word)
    lists = {name: _texts(name, document[name]) for name in ("scopes", "robots") if name in document}
    check_robots(lists.get("robots", ()))
    if "openid" not in lists.get("scopes", ("openid",)):
        raise ValueError("scopes lacks openid")
    return {**document, "roles": kept, **lists}


def _texts(name: str, values: Any) -> tuple[str, ...]:
    if not isinstance(values, list) or not all(isinstance(value, str) and value for value in values):
        raise ValueError(f"{name} is not a list of texts")
    return tuple(values)
