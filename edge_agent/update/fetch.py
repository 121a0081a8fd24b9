"""Signed files over HTTP, as `tuf` asks for them: with the fleet's trust and the robot's token, bounded in all ways.

Nothing here is believed: `tuf` checks every byte afterwards. What counts is that no answer can hold the robot up or
fill its disk. A head comes within `head_s`; after that so many bytes a second must come, and never more than asked.
Targets go on where an earlier attempt ended, from a part on the disk that goes away once it proves to be wrong.
"""

from __future__ import annotations

import contextlib
import hashlib
import http.client
import os
import socket
import ssl
import threading
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO
from urllib.parse import SplitResult, urlsplit

from tuf.api.exceptions import (
    DownloadError,
    DownloadHTTPError,
    DownloadLengthMismatchError,
    SlowRetrievalError,
)
from tuf.ngclient import FetcherInterface

from edge_agent.identity.gateway_http import is_loopback
from metaros.clock import Clock
from metaros.limits import LIMITS

__all__ = ["RobotFetcher", "TransferLimits"]

PIECE_BYTES = 64 * 1024
PARTS_KEPT = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class TransferLimits:
    """How slow a gateway may be: seconds to an answer's head, and the least that comes in a span after it."""

    head_s: float = 30.0
    span_s: float = LIMITS.update_stall_s
    span_bytes: int = LIMITS.update_stall_bytes


class RobotFetcher(FetcherInterface):
    """One gateway's signed files. `token()` is the newest that the gateway gave; "" = it gave none. Methods block."""

    def __init__(
        self,
        tls: ssl.SSLContext,
        token: Callable[[], str],
        parts: Path,
        clock: Clock,
        *,
        patience: TransferLimits | None = None,
    ) -> None:
        self._tls = tls
        self._token = token
        self._parts = parts
        self._clock = clock
        self._patience = patience or TransferLimits()

    def _fetch(self, url: str) -> Iterator[bytes]:
        with self._answer(url, 0) as (response, _):
            yield from self._pieces(url, response)

    @contextmanager
    def download_file(self, url: str, max_length: int) -> Iterator[IO[bytes]]:
        """The whole file; a target's (its name begins with its hash) is kept in part where the way breaks off."""
        if max_length > LIMITS.update_bytes:
            raise DownloadLengthMismatchError(f"{_name(url)} has {max_length} bytes: over {LIMITS.update_bytes}")
        if "/targets/" not in url:
            with super().download_file(url, max_length) as plain:
                yield plain
            return
        part = self._part(url)
        with part.open("a+b") as file:
            self._fill(url, file, max_length)
        try:
            with part.open("rb") as whole:
                yield whole
        finally:  # it was taken, or is wrong: never go on from it
            part.unlink(missing_ok=True)

    def _fill(self, url: str, file: IO[bytes], size_bytes: int) -> None:
        """Bring the part up to its length; what was got stays when it breaks off."""
        had = file.seek(0, os.SEEK_END)
        if had >= size_bytes:
            return
        with self._answer(url, had) as (response, start):
            if start != had:
                file.truncate(0)
            got = start
            if start + (response.length or 0) > size_bytes:
                raise DownloadLengthMismatchError(f"{_name(url)}: more than the {size_bytes} bytes that were signed")
            for piece in self._pieces(url, response):
                got += len(piece)
                if got > size_bytes:
                    file.truncate(0)
                    raise DownloadLengthMismatchError(
                        f"{_name(url)}: more than the {size_bytes} bytes that were signed"
                    )
                file.write(piece)
                file.flush()

    def _part(self, url: str) -> Path:
        """The file of a target that has not all come; the oldest of too many others go."""
        self._parts.mkdir(mode=0o700, parents=True, exist_ok=True)
        path = self._parts / f"{hashlib.sha256(urlsplit(url).path.encode()).hexdigest()}.part"
        others = [found for found in self._parts.glob("*.part") if found != path]
        for old in sorted(others, key=lambda found: found.stat().st_mtime_ns)[: -(PARTS_KEPT - 1)]:
            old.unlink(missing_ok=True)
        return path

    @contextmanager
    def _answer(self, url: str, start: int) -> Iterator[tuple[http.client.HTTPResponse, int]]:
        """An open answer, and where in the file it begins."""
        parts = urlsplit(url)
        connection = self._connection(parts)
        try:
            with _cut_after(self._patience.head_s, connection) as cut:
                try:
                    connection.request("GET", parts.path, headers=self._headers(start))
                    response = connection.getresponse()
                except (OSError, http.client.HTTPException, ValueError) as error:
                    if cut.is_set() or isinstance(error, TimeoutError):
                        raise SlowRetrievalError(f"{_name(url)}: no answer in {self._patience.head_s:g} s") from error
                    raise DownloadError(f"cannot reach {parts.netloc}: {_why(error)}") from error
            with response:
                yield response, _begins(url, response, start)
        finally:
            connection.close()

    def _headers(self, start: int) -> dict[str, str]:
        headers = {"Accept-Encoding": "identity", "User-Agent": "metaros-agent"}
        if token := self._token():
            headers["Authorization"] = f"Bearer {token}"
        if start:
            headers["Range"] = f"bytes={start}-"
        return headers

    def _connection(self, parts: SplitResult) -> http.client.HTTPConnection:
        """Not yet open. The token goes to a gateway beyond this machine over TLS only."""
        host, patience_s = parts.hostname or "", min(self._patience.head_s, self._patience.span_s)
        if parts.scheme == "http":
            if not is_loopback(host):
                raise DownloadError(f"{parts.netloc} has no TLS")
            return http.client.HTTPConnection(host, parts.port, timeout=patience_s)
        proxy = None if is_loopback(host) or urllib.request.proxy_bypass(host) else _proxy()
        if proxy is None:
            return _Secured(host, parts.port, timeout_s=patience_s, tls=self._tls, names=host)
        through = _Secured(proxy.hostname or "", proxy.port, timeout_s=patience_s, tls=self._tls, names=host)
        through.set_tunnel(host, parts.port or 443)
        return through

    def _pieces(self, url: str, response: http.client.HTTPResponse) -> Iterator[bytes]:
        """The body, as it comes. `read1` gives what is there, so that the time is looked at between any two packets."""
        patience, since_s, since_bytes = self._patience, self._clock.monotonic_s(), 0
        missing = response.length
        while True:
            try:
                piece = response.read1(PIECE_BYTES)
            except TimeoutError as error:
                raise SlowRetrievalError(f"{_name(url)}: nothing came for {patience.span_s:g} s") from error
            except (OSError, http.client.HTTPException) as error:
                raise DownloadError(f"{_name(url)}: the connection broke: {_why(error)}") from error
            if not piece:
                break
            missing = None if missing is None else missing - len(piece)
            since_bytes += len(piece)
            if (now_s := self._clock.monotonic_s()) - since_s > patience.span_s:
                if since_bytes < patience.span_bytes:
                    raise SlowRetrievalError(f"{_name(url)}: {since_bytes} bytes in {patience.span_s:g} s is too slow")
                since_s, since_bytes = now_s, 0
            yield piece
        if missing:
            raise DownloadError(f"{_name(url)}: it ended {missing} bytes early")


class _Secured(http.client.HTTPSConnection):
    """TLS whose socket is known before the handshake, so that a handshake that never ends can be cut, too."""

    def __init__(self, host: str, port: int | None, *, timeout_s: float, tls: ssl.SSLContext, names: str) -> None:
        super().__init__(host, port, timeout=timeout_s, context=tls)
        self._tls, self._names = tls, names

    def connect(self) -> None:
        """Connect, through the proxy if there is one, and shake hands."""
        http.client.HTTPConnection.connect(self)
        secured = self._tls.wrap_socket(self.sock, server_hostname=self._names, do_handshake_on_connect=False)
        self.sock = secured
        secured.do_handshake()


@contextmanager
def _cut_after(seconds: float, connection: http.client.HTTPConnection) -> Iterator[threading.Event]:
    """Shut the connection when the block takes longer, whatever comes meanwhile in single bytes; the event says so."""
    cut = threading.Event()

    def close() -> None:
        cut.set()
        if connection.sock is not None:
            with contextlib.suppress(OSError):
                connection.sock.shutdown(socket.SHUT_RDWR)

    timer = threading.Timer(seconds, close)
    timer.daemon = True
    timer.start()
    try:
        yield cut
    finally:
        timer.cancel()
        timer.join()


def _begins(url: str, response: http.client.HTTPResponse, asked: int) -> int:
    """Where in the file the body begins: where it was asked, or at 0."""
    if response.headers.get("Content-Encoding", "identity") != "identity":
        raise DownloadError(f"{_name(url)} comes packed, which was not asked for")
    if response.status in (200, 206) and (response.chunked or response.length is None):
        raise DownloadError(f"{_name(url)} comes without its length")  # its end would be the other side's to choose
    if response.status == 200:
        return 0
    if response.status == 206 and response.headers.get("Content-Range", "").startswith(f"bytes {asked}-"):
        return asked
    raise DownloadHTTPError(f"{_name(url)}: HTTP {response.status}", response.status)


def _proxy() -> SplitResult | None:
    found = urllib.request.getproxies().get("https", "")
    return urlsplit(found) if urlsplit(found).hostname else None


def _name(url: str) -> str:
    return urlsplit(url).path.rpartition("/")[2][-100:]


def _why(error: Exception) -> str:
    if isinstance(error, ssl.SSLCertVerificationError):
        return f"its TLS certificate is not to be trusted: {error.verify_message}"
    return str(getattr(error, "strerror", None) or error or type(error).__name__)
