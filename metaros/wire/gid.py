"""Global ids: an endpoint's GID is the XXH3-128 of its liveliness token, so peers compute it without asking."""

from __future__ import annotations

import xxhash

__all__ = ["gid_of"]


def gid_of(token: str) -> bytes:
    """The 16-byte GID of the entity behind a liveliness token: low 64 bits first, each half little-endian."""
    return xxhash.xxh3_128(token.encode()).intdigest().to_bytes(16, "little")
