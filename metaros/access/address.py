"""A gateway's address as people write it."""

from __future__ import annotations

from urllib.parse import urlsplit

from metaros.errors import ConfigError

__all__ = ["DEFAULT_URL", "origin"]

DEFAULT_URL = "http://127.0.0.1:8080"


def origin(text: str) -> str:
    """Scheme, host and port of an address, http where it says no scheme; ConfigError for another text."""
    parts = urlsplit(text if "://" in text else f"http://{text}")
    try:
        port = parts.port
    except ValueError:
        port = -1
    if parts.scheme not in ("http", "https") or not parts.hostname or port == -1:
        raise ConfigError(f"gateway {text!r}: not the address of a gateway\nit looks like {DEFAULT_URL}")
    return f"{parts.scheme}://{parts.netloc}"
