"""A connection to a gateway over http or https, and whom to believe that it is the right one. Standard library.

For https that is: the file of `metaros --ca FILE` or `$METAROS_CA` alone; else, for a gateway on this machine, its own
root, whose path it wrote into `~/.metaros/credentials`; else this system's authorities.
"""

from __future__ import annotations

import http.client
import ssl
from pathlib import Path
from urllib.parse import urlsplit

from metaros.access.credentials import ca_for
from metaros.errors import ConfigError

__all__ = ["distrust", "open_connection", "tls_context"]


def tls_context(url: str, *, ca: Path | None = None) -> ssl.SSLContext | None:
    """Whom to believe at `url`; None where it is no https. `ca`: only these roots.

    Raises:
        ConfigError: the file of roots cannot be read.
    """
    if urlsplit(url).scheme != "https":
        return None
    roots = ca or ca_for(url)
    try:
        context = ssl.create_default_context(cafile=roots)
    except (OSError, ssl.SSLError) as error:
        what = error.strerror if isinstance(error, OSError) and not isinstance(error, ssl.SSLError) else "no PEM"
        raise ConfigError(f"root certificates {roots}: {what or error}") from error
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    return context


def open_connection(url: str, *, timeout_s: float, ca: Path | None = None) -> http.client.HTTPConnection:
    """A connection that has not asked anything yet; proxies of the environment are not used.

    Raises:
        ConfigError: the file of roots cannot be read.
    """
    parts = urlsplit(url)
    host, port = parts.hostname or "", parts.port
    context = tls_context(url, ca=ca)
    if context is None:
        return http.client.HTTPConnection(host, port, timeout=timeout_s)
    return http.client.HTTPSConnection(host, port, timeout=timeout_s, context=context)


def distrust(url: str, error: BaseException) -> str:
    """What to tell when the certificate at `url` is not believed, and the ways out; "" for another error."""
    if not isinstance(error, ssl.SSLCertVerificationError):
        return ""
    if error.verify_code in (62, 64):  # host name or address mismatch
        host = urlsplit(url).hostname
        return (
            f"the certificate at {url} is not for {host!r}\n"
            f"use a name that it holds, or start the gateway with --allow-host {host}"
        )
    return (
        f"the certificate at {url} is not trusted: {error.verify_message}\n"
        "its root is root.pem in the gateway's data directory: copy it here, then `metaros --ca root.pem …` or "
        "METAROS_CA=root.pem"
    )
