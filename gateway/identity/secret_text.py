"""Secrets as text: made by the operating system, kept as SHA-256.

A hash without salt or delay suffices, as there are 256 bits to guess.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets

__all__ = ["new_id", "new_secret", "same_secret", "secret_hash"]

SECRET_BYTES = 32


def new_secret() -> str:
    """256 bits, hexadecimal: fits into a header, a WebSocket subprotocol and an address."""
    return secrets.token_hex(SECRET_BYTES)


def new_id() -> str:
    """64 bits, hexadecimal: names something for ever and opens nothing."""
    return secrets.token_hex(8)


def secret_hash(text: str) -> str:
    """What is stored of a secret; also of text that never was one."""
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


def same_secret(stored_hash: str, text: str) -> bool:
    """Whether `text` is the secret, compared in a time that tells nothing."""
    return hmac.compare_digest(stored_hash, secret_hash(text))
