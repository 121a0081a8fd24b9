"""TLS of the gateway's HTTP port: our own certificate as the authority makes it, and a pair of files made elsewhere.

`HttpTls.context` is asked at every handshake and is cheap: it loads anew when a pair changed, so a renewed certificate
is served to the next connection, and those that are open go on. Files that became unreadable, or do not belong together
at the moment because only one of them is replaced yet, leave what was served before.

With files there are two certificates: who calls by a name that the supplied one does not hold gets our own. So this
machine's programs, which call 127.0.0.1, always find the root that the gateway left for them in `root.pem`.
"""

from __future__ import annotations

import contextlib
import logging
import os
import secrets
import ssl
from collections.abc import Callable
from pathlib import Path

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from gateway.identity.certificates.ca import ServerPair
from gateway.server.certificate_files import CertificateFiles
from metaros.clock import Clock
from metaros.errors import ConfigError

__all__ = ["ROOT_FILE", "HttpTls", "http_tls", "strict_transport"]

log = logging.getLogger(__name__)

ROOT_FILE = "root.pem"  # in the data directory: what clients of the gateway need to trust it
HSTS = (b"strict-transport-security", b"max-age=2592000")  # 30 days: long for a thief, short for a mistake


class HttpTls:
    """What the HTTP port shows now."""

    def __init__(
        self,
        pair: Callable[[], ServerPair | None],
        files: CertificateFiles | None = None,
        *,
        folder: Path,
        on_pair: Callable[[], None] = lambda: None,
    ) -> None:
        """`pair` is our own; `files` go before it. OpenSSL reads keys from files alone: one is made in `folder`, and
        is gone at once. `on_pair` is called after each load of our own.

        Raises:
            ConfigError: there is no pair, or it cannot be used.
        """
        self._pair = pair
        self._files = files
        self._on_pair = on_pair
        self._own = _Slot(pair, self._read_own, folder)
        self._supplied = _Slot(files.stamp, files.read, folder) if files is not None else None

    @property
    def stays(self) -> bool:
        """Whether browsers may be told to insist on https: the certificate is one that this system trusts."""
        return self._files is not None and self._files.is_trusted

    def context(self) -> ssl.SSLContext:
        """The context for the next connection."""
        context = (self._supplied or self._own).context()
        # Also where a server asks for a context once and keeps it, each connection gets the one of the moment.
        context.sni_callback = self._choose
        return context

    def pairs(self) -> tuple[tuple[bytes, bytes], ...]:
        """Chain and key in PEM of each certificate, for a server that takes the first one which holds the name.

        Such a server shows the very first where there is no name: who calls by an address gets the supplied one.
        """
        return tuple(slot.pair() for slot in (self._supplied, self._own) if slot is not None)

    def _choose(self, connection: ssl.SSLObject, name: str | None, _context: ssl.SSLContext) -> None:
        supplied = self._supplied is not None and self._files is not None and self._files.holds(name)
        connection.context = self._supplied.context() if supplied and self._supplied else self._own.context()

    def _read_own(self) -> tuple[bytes, bytes]:
        pair = self._pair()
        if pair is None:
            raise ConfigError("the gateway has no certificate for its HTTP port")
        self._on_pair()
        return pair.chain_pem, pair.key_pem


class _Slot:
    """A pair and its context, loaded anew when its stamp is another one."""

    def __init__(self, stamp: Callable[[], object], read: Callable[[], tuple[bytes, bytes]], folder: Path) -> None:
        self._stamp = stamp
        self._read = read
        self._folder = folder
        self._seen_stamp = stamp()
        self._context = self._load()

    def context(self) -> ssl.SSLContext:
        stamp = self._stamp()
        if stamp != self._seen_stamp:
            self._seen_stamp = stamp  # a fault is said once; whatever changes next is tried again
            try:
                self._context = self._load()
            except ConfigError as error:
                log.error("the changed certificate is not used, the one before is: %s", error)
        return self._context

    def pair(self) -> tuple[bytes, bytes]:
        """Chain and key of the context."""
        self.context()
        return self._pair

    def _load(self) -> ssl.SSLContext:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        context.set_alpn_protocols(["http/1.1"])
        pair = self._read()
        _load_chain(context, *pair, self._folder)
        self._pair = pair
        return context


def strict_transport(app: ASGIApp, tls: HttpTls) -> ASGIApp:
    """The application, which tells browsers to come by https alone while the certificate is one they trust.

    Never with our own root: a browser that once heard it could not even be made to go on past a warning.
    """

    async def wrapped(scope: Scope, receive: Receive, send: Send) -> None:
        async def sending(message: Message) -> None:
            if message["type"] == "http.response.start" and tls.stays:
                message = {**message, "headers": [*message.get("headers", []), HSTS]}
            await send(message)

        await app(scope, receive, sending if scope["type"] == "http" else send)

    return wrapped


def http_tls(
    pair: Callable[[], ServerPair | None],
    roots: Callable[[], str],
    *,
    cert: Path | None,
    key: Path | None,
    folder: Path,
    clock: Clock,
) -> HttpTls:
    """TLS by our own pair, and by the supplied files where there are some; `root.pem` follows `roots`.

    Raises:
        ConfigError: it cannot be; the message says which file is wrong.
    """
    files = CertificateFiles(cert, key, clock=clock) if cert is not None and key is not None else None
    return HttpTls(pair, files, folder=folder, on_pair=lambda: _replace(folder / ROOT_FILE, roots().encode(), 0o644))


def _load_chain(context: ssl.SSLContext, chain_pem: bytes, key_pem: bytes, folder: Path) -> None:
    """Give OpenSSL chain and key through a file that is this user's alone, and gone at once."""
    path = folder / f"tls-{secrets.token_hex(8)}.pem"
    try:
        _replace(path, key_pem + b"\n" + chain_pem, 0o600)
        context.load_cert_chain(path)
    except ssl.SSLError as error:
        raise ConfigError(f"OpenSSL does not take the certificate: {error.reason or error}") from error
    finally:
        with contextlib.suppress(OSError):
            path.unlink()


def _replace(path: Path, text: bytes, mode: int) -> None:
    """Write a file in one step; ConfigError when it cannot be."""
    partial = path.with_name(f"{path.name}.{secrets.token_hex(4)}")
    try:
        with os.fdopen(os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as file:
            file.write(text)
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise ConfigError(f"cannot write {path}: {error.strerror or error}") from error
