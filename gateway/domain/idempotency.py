"""Idempotency keys of clients, and the digest by which a repeated request is recognised."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import orjson

from gateway.domain.principal import Principal
from gateway.errors import InvalidRequestError

__all__ = ["IdempotentRequest", "check_key"]

KEY_CHARS = 200


def check_key(key: str) -> None:
    """InvalidRequestError for what is no Idempotency-Key."""
    if not (0 < len(key) <= KEY_CHARS and key.isprintable()):
        raise InvalidRequestError(f"Idempotency-Key is 1 to {KEY_CHARS} printable characters")


@dataclass(frozen=True, slots=True)
class IdempotentRequest:
    """A request with an Idempotency-Key, which makes something once; `digest` is of what was asked."""

    issuer: str  # "user:ID" or "key:ID": keys of others are other keys
    key: str
    digest: str

    @classmethod
    def of(cls, principal: Principal, key: str, asked: Mapping[str, Any]) -> IdempotentRequest:
        """`asked` is JSON, without secrets: its digest is stored. InvalidRequestError for what is no key."""
        check_key(key)
        digest = hashlib.sha256(orjson.dumps(asked, option=orjson.OPT_SORT_KEYS)).hexdigest()
        return cls(f"{principal.kind}:{principal.id}", key, digest)
