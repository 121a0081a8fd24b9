"""What a handler reaches through its proxy, with the libraries that handlers use, at each level of the sandbox."""

from __future__ import annotations

import asyncio
import ssl
import threading
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio

from metaros.automation.functions.egress.rules import EgressRules
from metaros.automation.functions.logs import LogPiece
from metaros.automation.functions.probe import probe
from metaros.automation.functions.sandbox.level import Level
from metaros.automation.functions.zygote import Zygote
from tests.support.functions.functions import Bench, alive, running_engine
from tests.support.functions.sandboxed_worker import listening
from tests.support.servers.certificates import make_certificate
from tests.support.waiting import wait_until_async

LIBRARIES = """
import os, socket, ssl

def certificate(event):
    with open("/tmp/ca.pem" if os.environ["TMPDIR"] == "/tmp" else os.environ["TMPDIR"] + "/ca.pem", "w") as f:
        f.write(event["ca"])
    return f.name

def by_urllib(event):
    import urllib.request
    context = ssl.create_default_context(cadata=event["ca"])
    asked = urllib.request.Request(event["url"] + "/x", data=event["text"].encode(), method="PUT")
    return urllib.request.urlopen(asked, timeout=20, context=context).read().decode()

def by_httpx(event):
    import httpx
    context = ssl.create_default_context(cadata=event["ca"])
    with httpx.Client(verify=context, timeout=20) as client:
        return [client.put(event["url"] + "/x", content=event["text"]).text for _ in range(3)][-1]

def by_requests(event):
    import requests
    with requests.Session() as session:
        verify = certificate(event)
        put = lambda: session.put(event["url"] + "/x", data=event["text"], timeout=20, verify=verify).text
        return [put() for _ in range(3)][-1]

def by_boto3(event):
    import boto3
    s3 = boto3.client("s3", endpoint_url=event["url"], region_name="eu-central-1", aws_access_key_id="a",
                      aws_secret_access_key="b", verify=certificate(event))
    s3.put_object(Bucket="bucket", Key="x", Body=event["text"].encode())
    return s3.get_object(Bucket="bucket", Key="x")["Body"].read().decode()

def by_socket(event):
    proxy = os.environ["HTTPS_PROXY"].removeprefix("http://").split(":")
    with socket.create_connection((proxy[0], int(proxy[1])), timeout=20) as sock:
        sock.sendall(f"CONNECT {event['target']} HTTP/1.1\\r\\n\\r\\n".encode())
        return sock.makefile("rb").readline().decode().strip()

def directly(event):
    try:
        socket.create_connection(tuple(event["address"]), timeout=20).close()
        return "open"
    except OSError as error:
        return type(error).__name__

def proxies(event):
    return sorted(name for name in os.environ if "proxy" in name.lower())

def handler(event, context):
    return globals()[event["by"]](event)
"""
HELD = """
import os, socket
def handler(event, context):
    address = os.environ["HTTPS_PROXY"].removeprefix("http://").split(":")
    sock = socket.create_connection((address[0], int(address[1])))
    sock.sendall(f"CONNECT {event} HTTP/1.1\\r\\n\\r\\n".encode())
    while True:
        sock.recv(65536)
"""
LEVELS = (Level.L1, Level.L2, Level.L3)


class Storage(BaseHTTPRequestHandler):
    """Keeps what is put, and says it back."""

    protocol_version = "HTTP/1.1"
    kept = b""

    def do_PUT(self) -> None:
        body = self._chunks() if "chunked" in self.headers.get("Transfer-Encoding", "") else self._sized()
        if self.headers.get("Content-Encoding") == "aws-chunked":  # boto3's own way for checksums, inside the other
            body = body.split(b"\r\n")[1]
        type(self).kept = body
        self._answer(b"" if "bucket" in self.path else body)  # S3 takes a text that is no XML for an error

    def do_GET(self) -> None:
        self._answer(type(self).kept)

    def _sized(self) -> bytes:
        return self.rfile.read(int(self.headers["Content-Length"]))

    def _chunks(self) -> bytes:
        body = b""
        while size := int(self.rfile.readline().split(b";")[0], 16):
            body += self.rfile.read(size)
            self.rfile.readline()
        while self.rfile.readline().strip():
            pass
        return body

    def _answer(self, body: bytes) -> None:
        self.send_response(200)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *args: object) -> None:
        """Say nothing."""


class Server:
    """HTTP or HTTPS on this machine."""

    def __init__(self, folder: Path | None = None) -> None:
        kind = type("Kept", (Storage,), {})
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), kind)
        self._server.daemon_threads = True
        self.port = self._server.server_port
        self.url = f"http://127.0.0.1:{self.port}"
        if folder is not None:
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            certificate = make_certificate(folder)
            context.load_cert_chain(certificate, certificate.with_suffix(".key"))
            self._server.socket = context.wrap_socket(self._server.socket, server_side=True)
            self.url = f"https://localhost:{self.port}"
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.05,))
        self._thread.start()

    def close(self) -> None:
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()


pytestmark = pytest.mark.asyncio(loop_scope="module")


@pytest.fixture(scope="module")
def plain() -> Iterator[Server]:
    server = Server()
    yield server
    server.close()


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the secure server's certificate."""
    return tmp_path_factory.mktemp("authority")


@pytest.fixture(scope="module")
def secure(authority: Path) -> Iterator[Server]:
    server = Server(authority)
    yield server
    server.close()


@pytest_asyncio.fixture(params=LEVELS, ids=lambda level: level.name, scope="module", loop_scope="module")
async def bench(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Bench]:
    async with at_level(request.param, tmp_path_factory.mktemp("bench")) as bench:
        yield bench


@asynccontextmanager
async def at_level(level: Level, folder: Path) -> AsyncIterator[Bench]:
    """An engine; a level that is not to be had here skips the test."""
    reason = (await asyncio.to_thread(probe)).reasons[level]
    if reason != "ok":
        pytest.skip(f"{level.name}: {reason}")
    async with running_engine(folder, level=level) as bench:
        yield bench


def function(bench: Bench, egress: str, source: str = LIBRARIES, **options: Any) -> Any:
    environment = {"METAROS_EGRESS": egress} if egress else {}
    return bench.spec(source, environment=environment, memory_mb=256, **options)


async def test_libraries_reach_what_is_allowed(bench: Bench, plain: Server, secure: Server, authority: Path) -> None:
    spec = function(bench, f"127.0.0.1:{plain.port}, private:localhost:{secure.port}")
    ca = (authority / "localhost.pem").read_text()
    # how a library uses its proxy is the same at each level: the lower ones only show that it is reached
    libraries = ("urllib", "httpx", "requests", "boto3") if bench.engine.status().level == Level.L3 else ("urllib",)
    for library in libraries:
        for server in (plain, secure):
            event = {"by": f"by_{library}", "url": server.url, "ca": ca, "text": f"{library} to {server.url}"}
            assert await bench.returned(spec, event) == f"{library} to {server.url}"


async def test_all_else_is_refused_and_said(bench: Bench, plain: Server) -> None:
    spec = function(bench, f"127.0.0.1:{plain.port}, localhost:{plain.port}")
    for target in (
        "127.0.0.1:1",
        f"localhost:{plain.port}",
        "169.254.169.254:80",
        f"[::1]:{plain.port}",
        "a.example:443",
    ):
        outcome = await bench.invoke(spec, {"by": "by_socket", "target": target})
        assert outcome.payload == b'"HTTP/1.1 403 Forbidden"'
        assert f"[{target}" in outcome.log.decode()
    assert await bench.returned(spec, {"by": "by_socket", "target": f"127.0.0.1:{plain.port}"}) == (
        "HTTP/1.1 200 Connection established"
    )


async def test_a_way_out_is_no_way_around_the_proxy(bench: Bench, plain: Server) -> None:
    level = bench.engine.status().level
    for egress in ("", f"127.0.0.1:{plain.port}"):
        spec = function(bench, egress)
        found = await bench.returned(spec, {"by": "directly", "address": ["127.0.0.1", plain.port]})
        refused = {Level.L3: "ConnectionRefusedError", Level.L2: "PermissionError", Level.L1: "open"}
        assert found == refused[level]


async def test_nothing_is_set_where_nothing_is_asked_for(bench: Bench) -> None:
    assert await bench.returned(function(bench, ""), {"by": "proxies"}) == []
    names = await bench.returned(function(bench, "a.example"), {"by": "proxies"})
    assert names == ["HTTPS_PROXY", "HTTP_PROXY", "NO_PROXY", "http_proxy", "https_proxy", "no_proxy"]
    if bench.engine.status().level == Level.L3:
        own = await bench.returned(function(bench, ""), {"by": "directly", "address": ["127.0.0.1", 9002]})
        assert own == "ConnectionRefusedError"


@pytest.mark.parametrize("level", LEVELS, ids=lambda level: level.name)
async def test_a_worker_that_is_killed_leaves_no_connection(level: Level, tmp_path: Path) -> None:
    async with at_level(level, tmp_path) as bench:
        await leaves_no_connection(bench)


async def leaves_no_connection(bench: Bench) -> None:
    with listening() as far:
        target = f"127.0.0.1:{far.getsockname()[1]}"
        spec = function(bench, target, HELD)
        task = asyncio.create_task(bench.invoke(spec, target))
        far.setblocking(False)
        connection, _ = await asyncio.get_running_loop().sock_accept(far)
        with connection:
            sending = asyncio.create_task(_send_for_ever(connection))
            (pid,) = bench.engine.pids(spec.key)
            await bench.engine.close()
            with pytest.raises(ConnectionError):
                await sending
            with pytest.raises(Exception, match="closed"):
                await task
            await wait_until_async(lambda: not alive(pid))


async def _send_for_ever(connection: Any) -> None:
    connection.setblocking(False)
    while True:
        await asyncio.get_running_loop().sock_sendall(connection, bytes(65_536))


async def test_a_pattern_that_is_none_fails_the_start(bench: Bench) -> None:
    outcome = await bench.invoke(function(bench, "https://a.example"), {"by": "proxies"})
    assert outcome.error_type == "Sandbox.InvalidEgress"
    assert b"'https://a.example' is no pattern" in outcome.payload


async def test_the_operator_may_allow_none(zygote: Zygote, tmp_path: Path, plain: Server) -> None:
    pieces: list[LogPiece] = []
    async with running_engine(tmp_path, launch=zygote.fork, egress=EgressRules()) as bench:
        bench.engine.on_log(pieces.append)
        spec = function(bench, f"127.0.0.1:{plain.port}")
        answer = await bench.returned(spec, {"by": "by_socket", "target": f"127.0.0.1:{plain.port}"})
    assert answer == "HTTP/1.1 403 Forbidden"
    assert any("--function-egress" in piece.text for piece in pieces)
