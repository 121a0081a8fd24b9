"""Where the gateway is, who asks, and whom to believe that it is the right one: by argument, environment, or context.

As the command line finds them: `$METAROS_GATEWAY_URL`, else the current context (`metaros context use NAME`), else the
gateway that runs on this machine; `$METAROS_KEY`, else this user's key for that gateway; `$METAROS_CA`, else the root
of a gateway on this machine, else this system's authorities.
"""

from __future__ import annotations

import os
import ssl
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from metaros.access.address import DEFAULT_URL, origin
from metaros.access.contexts import current_gateway
from metaros.access.credentials import ca_for, key_for, local_gateway
from metaros.access.trust import tls_context
from metaros.errors import ConfigError

__all__ = ["Access", "find_access"]


@dataclass(frozen=True, slots=True)
class Access:
    """One gateway for one user; `key` "" is nobody's, `ca` None is this system's authorities."""

    url: str
    key: str
    ca: Path | None

    @property
    def host(self) -> str:
        """The host's name, as an address has it."""
        name = urlsplit(self.url).hostname or ""
        return f"[{name}]" if ":" in name else name

    @property
    def tls(self) -> bool:
        """Whether it speaks TLS."""
        return self.url.startswith("https:")

    @property
    def headers(self) -> dict[str, str]:
        """What says who asks, over HTTP and, in small letters, over gRPC."""
        return {"authorization": f"Bearer {self.key}"} if self.key else {}

    def tls_context(self) -> ssl.SSLContext | None:
        """For https; None where it is http. ConfigError when the roots cannot be read."""
        return tls_context(self.url, ca=self.ca)

    def roots_pem(self) -> bytes | None:
        """For gRPC; None: its own authorities. ConfigError when the file cannot be read."""
        if self.ca is None:
            return None
        try:
            return self.ca.read_bytes()
        except OSError as error:
            raise ConfigError(f"root certificates {self.ca}: {error.strerror or error}") from error


def find_access(gateway: str = "", *, key: str | None = None, ca: str | Path | None = None) -> Access:
    """What is not given is looked up.

    Raises:
        ConfigError: the address is none, or the user's files cannot be read.
    """
    text = gateway or os.environ.get("METAROS_GATEWAY_URL", "").strip() or current_gateway() or local_gateway()
    url = origin(text or DEFAULT_URL)
    found = key_for(url) if key is None else key
    return Access(url, found, Path(ca) if ca is not None else ca_for(url))
