"""The command line as a client of a gateway: where it is, JSON requests, and files with a resume. Standard library."""

from __future__ import annotations

import http.client
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import quote, urlencode

import typer

from metaros.access.address import DEFAULT_URL, origin
from metaros.access.credentials import key_for, local_gateway
from metaros.access.trust import distrust, open_connection
from metaros.errors import PeerError, RefusedError, UnavailableError

__all__ = ["Answer", "GatewayClient", "GatewayOption", "events", "open_gateway", "path_part"]

PIECE_BYTES = 256 * 1024

GatewayOption = Annotated[
    str,
    typer.Option(
        "--gateway",
        metavar="URL",
        envvar="METAROS_GATEWAY_URL",
        show_envvar=False,
        help=f"The gateway's address; default: the context's, else the one on this machine, else {DEFAULT_URL}.",
    ),
]


@dataclass(frozen=True, slots=True)
class Answer:
    """An answer that is read piece by piece while it comes."""

    status: int
    headers: Mapping[str, str]
    _response: http.client.HTTPResponse

    @property
    def size_bytes(self) -> int | None:
        """How much will come; None where the gateway does not know yet."""
        length = self._response.getheader("Content-Length")
        return int(length) if length is not None and length.isdigit() else None

    def pieces(self) -> Iterator[bytes]:
        """The body; PeerError when the connection ends before it does."""
        try:
            while piece := self._response.read1(PIECE_BYTES):
                yield piece
            if self._response.length:
                raise PeerError(f"the gateway ended the connection {self._response.length} bytes early")
        except (OSError, http.client.HTTPException) as error:
            raise PeerError(f"the connection to the gateway broke: {error}") from error


class GatewayClient:
    """Requests to one gateway, each on a connection of its own; proxies of the environment are not used."""

    def __init__(self, url: str, *, timeout_s: float = 60.0, key: str | None = None) -> None:
        """`key`: an API key, "" for none; None: this user's own for that gateway.

        Raises:
            ConfigError: `url` is none of http or https with a host, or the user's keys cannot be read.
        """
        self.url = origin(url)
        self._timeout_s = timeout_s
        # The headers that say who asks.
        own = key_for(self.url) if key is None else key
        self.identity = {"Authorization": f"Bearer {own}"} if own else {}

    def get(self, path: str, **query: Any) -> Any:
        """The JSON of a GET; a value of `query` may be a list, None leaves it out."""
        with self.open("GET", path, query=query) as answer:
            return _document(answer)

    def pages(self, path: str, name: str, **query: Any) -> Iterator[Any]:
        """The items of a list that comes in pages, under `name`, until the gateway names no `next` one."""
        cursor: Any = None
        while True:
            page = self.get(path, **{**query, "after": cursor} if cursor is not None else query)
            yield from page[name]
            if (cursor := page.get("next")) is None:
                return

    def post(self, path: str, body: Mapping[str, Any]) -> Any:
        """The JSON that answers a POST."""
        with self.open("POST", path, body=body) as answer:
            return _document(answer)

    def send(self, path: str, file: Path, *, kind: str, **query: Any) -> Any:
        """The JSON that answers a POST of a file."""
        with self.open("POST", path, query=query, headers={"Content-Type": kind}, file=file) as answer:
            return _document(answer)

    def send_bytes(self, path: str, content: bytes, *, kind: str, **query: Any) -> Any:
        """The JSON that answers a POST of a few bytes."""
        with self.open("POST", path, query=query, headers={"Content-Type": kind}, content=content) as answer:
            return _document(answer)

    def patch(self, path: str, body: Mapping[str, Any]) -> Any:
        """The JSON that answers a PATCH."""
        with self.open("PATCH", path, body=body) as answer:
            return _document(answer)

    def delete(self, path: str) -> Any:
        """The JSON that answers a DELETE."""
        with self.open("DELETE", path, body={}) as answer:
            return _document(answer)

    @contextmanager
    def open(
        self,
        method: str,
        path: str,
        *,
        query: Mapping[str, Any] | None = None,
        body: Mapping[str, Any] | None = None,
        headers: Mapping[str, str] | None = None,
        file: Path | None = None,
        content: bytes | None = None,
    ) -> Iterator[Answer]:
        """One request and its good answer; `file`, piece by piece, and `content` go under a type in `headers`.

        Raises:
            UnavailableError: nobody answers at the address.
            RefusedError: the gateway says that the request cannot be, or that it, or the robot, could not do it.
        """
        asked = urlencode({k: v for k, v in (query or {}).items() if v is not None}, doseq=True)
        kind = {} if body is None else {"Content-Type": "application/json"}
        connection, response = open_connection(self.url, timeout_s=self._timeout_s), None
        sent: Any = content if body is None else json.dumps(body).encode()
        if file is not None:
            sent, kind = file.open("rb"), {"Content-Length": str(file.stat().st_size)}
        try:
            try:
                connection.request(
                    method,
                    f"{path}?{asked}" if asked else path,
                    body=sent,
                    headers={**self.identity, **kind, **(headers or {})},
                )
                response = connection.getresponse()
            except (OSError, http.client.HTTPException) as error:
                raise UnavailableError(distrust(self.url, error) or _silence(self.url, error)) from error
            answer = Answer(response.status, {k.lower(): v for k, v in response.getheaders()}, response)
            if response.status >= 400:
                raise _refusal(answer)
            yield answer
        finally:
            if response is not None:  # a socket of `Connection: close` is the answer's, not the connection's
                response.close()
            connection.close()
            if file is not None:
                sent.close()


def _silence(url: str, error: Exception) -> str:
    """Nobody answers, or somebody who speaks otherwise."""
    fix = "`metaros status` shows what runs; --gateway URL names another one"
    if url.startswith("http://") and isinstance(error, http.client.HTTPException | ConnectionResetError):
        fix = f"it may speak TLS: --gateway {url.replace('http', 'https', 1)}"
    return f"no gateway answers at {url}: {error}\n{fix}"


def events(answer: Answer) -> Iterator[tuple[str, Any]]:
    """The server-sent events of an answer: name and data."""
    rest, name = b"", ""
    for piece in answer.pieces():
        *lines, rest = (rest + piece).split(b"\n")
        for line in lines:
            key, _, value = line.decode().partition(": ")
            if key == "event":
                name = value
            elif key == "data":
                yield name, json.loads(value)
            elif not line:  # the event's end, and its name's
                name = ""


def open_gateway(url: str) -> GatewayClient:
    """The gateway at `url`; "": the context's, else the one of this user's running `metaros up`."""
    if not url:
        from metaros.access.contexts import current_gateway

        url = current_gateway()
    if not url:
        from metaros.cli.shared.instances import running_instances

        url = next((found.url for found in running_instances() if found.url), "") or local_gateway() or DEFAULT_URL
    return GatewayClient(url)


def path_part(text: str) -> str:
    """A text as one part of a path."""
    return quote(text, safe="")


def _document(answer: Answer) -> Any:
    raw = b"".join(answer.pieces())
    try:
        return json.loads(raw) if raw else None
    except ValueError as error:
        raise PeerError(f"what answers is no gateway: {raw[:80]!r}") from error


def _refusal(answer: Answer) -> RefusedError:
    """The gateway's problem document as an error."""
    raw, code = b"".join(answer.pieces()), ""
    try:
        document = json.loads(raw)
        text, code = str(document.get("detail") or document.get("title")), str(document.get("code", ""))
    except (ValueError, AttributeError):
        said = raw[:200].decode(errors="replace").strip() if answer.headers.get("content-type") == "text/plain" else ""
        text = f"the gateway answered {answer.status}" + (f": {said}" if said.isprintable() and said else "")
    return RefusedError(text, status=answer.status, reason=code)
