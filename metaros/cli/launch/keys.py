"""The key on which a launcher receives requests. Light: sending a request loads no node."""

from __future__ import annotations

__all__ = ["request_key"]


def request_key(domain: int, zid: str = "*") -> str:
    """The key of one launcher; of all of a domain without an id."""
    return f"@metaros/{domain}/{zid}/launch"
