"""HTTPS on the gateway's own port: what it shows, what it takes, and what it says of files that cannot serve."""

from __future__ import annotations

import asyncio
import socket
import ssl
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from cryptography import x509
from cryptography.hazmat.primitives.serialization import (
    BestAvailableEncryption,
    Encoding,
    PrivateFormat,
    load_pem_private_key,
)

from gateway.identity.certificates.ca import ServerPair, issue_server, make_intermediate, make_root
from gateway.main import Ready
from gateway.server.tls import HttpTls
from metaros.clock import SystemClock
from metaros.errors import ConfigError
from tests.gateway.harness import ScriptedAgent, client, hear, open_socket, running_gateway
from tests.support.gateways.plain_http import TRUSTS_NOBODY

CLOCK = SystemClock()
DAY_NS = 86_400 * 10**9


def shown_at(port: int, **options: Any) -> tuple[bytes, str | None]:
    """The leaf that a port shows, as DER, and the TLS version it agrees to."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    for name, value in options.items():
        setattr(context, name, value)
    with (
        socket.create_connection(("127.0.0.1", port), 30) as raw,
        context.wrap_socket(raw, server_hostname="localhost") as tls,
    ):
        return tls.getpeercert(binary_form=True) or b"", tls.version()


async def test_pages_rest_and_sockets_go_over_tls_under_the_fleets_root(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, tls="on") as ready:
        assert ready.url.startswith("https://127.0.0.1:")
        async with client(ready) as http:
            health = await http.get("/healthz")
            assert (health.status_code, (await http.get("/api/v1/robots")).status_code) == (200, 200)
            assert "strict-transport-security" not in health.headers  # with our own root it would lock people out
        async with open_socket(ready, "/api/v1/stream") as socket_:
            assert await hear(socket_, "welcome")
        leaf = x509.load_der_x509_certificate((await asyncio.to_thread(shown_at, ready.http_port))[0])
        names = leaf.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        assert {"localhost"} <= set(names.get_values_for_type(x509.DNSName))


async def test_nothing_older_than_tls_1_2_and_nothing_plain(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, tls="on") as ready:
        for version in (ssl.TLSVersion.TLSv1_2, ssl.TLSVersion.TLSv1_3):
            _, agreed = await asyncio.to_thread(shown_at, ready.http_port, maximum_version=version)
            assert agreed == version.name.replace("_", ".")
        with pytest.warns(DeprecationWarning, match="TLSv1_1"), pytest.raises((ssl.SSLError, ConnectionError)):
            await asyncio.to_thread(shown_at, ready.http_port, maximum_version=ssl.TLSVersion.TLSv1_1)
        async with httpx.AsyncClient(verify=TRUSTS_NOBODY, trust_env=False) as http:
            try:
                answer = await http.get(ready.url.replace("https", "http") + "/healthz")
            except httpx.TransportError:
                return
            assert answer.status_code == 400


async def test_the_cookie_and_the_printed_addresses_are_of_https(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, tls="on") as ready:
        async with client(ready, key=(ready.data_dir / "local.key").read_text().strip()) as http:
            link = (await http.post("/api/v1/auth/links", json={})).json()
            assert link["url"].startswith(f"{ready.url}/signin#")
            order = (await http.post("/api/v1/enrolment-tokens", json={})).json()
            assert f"--gateway {ready.url}" in order["command"]
        async with client(ready, key="", origin=ready.url) as http:
            signed_in = await http.post("/api/v1/auth/link", json={"token": link["token"]})
            assert "; Secure" in signed_in.headers["set-cookie"]


def write_pair(folder: Path, pair: ServerPair) -> tuple[Path, Path]:
    """As files."""
    folder.mkdir(parents=True, exist_ok=True)
    cert, key = folder / "fullchain.pem", folder / "privkey.pem"
    cert.write_bytes(pair.chain_pem)
    key.write_bytes(pair.key_pem)
    return cert, key


class Elsewhere:
    """An authority that has nothing to do with the gateway's."""

    def __init__(self) -> None:
        now_ns = CLOCK.wall_ns()
        self.root, key = make_root("elsewhere", now_ns=now_ns)
        self._issuer = make_intermediate("elsewhere", self.root, key, now_ns=now_ns)

    def pair(self, *names: str, now_ns: int | None = None) -> ServerPair:
        """A server's pair."""
        return issue_server(self._issuer, names, now_ns=CLOCK.wall_ns() if now_ns is None else now_ns)

    def file(self, folder: Path) -> Path:
        """The root as a file."""
        path = folder / "elsewhere.pem"
        path.write_bytes(self.root.public_bytes(Encoding.PEM))
        return path


async def ask(ready: Ready, root: Path, path: str = "/healthz") -> httpx.Response:
    """A GET that the root vouches for."""
    async with httpx.AsyncClient(verify=ssl.create_default_context(cafile=root), trust_env=False) as http:
        return await http.get(f"https://localhost:{ready.http_port}{path}")


async def test_a_supplied_pair_is_served_and_followed_when_the_files_change(tmp_path: Path) -> None:
    authority = Elsewhere()
    root, pair = authority.file(tmp_path), authority.pair("localhost")
    cert, key = write_pair(tmp_path / "tls", pair)
    async with running_gateway(tmp_path, tls_cert=cert, tls_key=key) as ready:  # auto: with files it is on
        assert (await ask(ready, root)).status_code == 200
        before, _ = await asyncio.to_thread(shown_at, ready.http_port)
        renewed = authority.pair("localhost")
        cert.write_bytes(renewed.chain_pem)  # half of a renewal: what was there goes on
        assert await asyncio.to_thread(shown_at, ready.http_port) == (before, "TLSv1.3")
        key.write_bytes(renewed.key_pem)
        after, _ = await asyncio.to_thread(shown_at, ready.http_port)
        assert after == x509.load_pem_x509_certificates(renewed.chain_pem)[0].public_bytes(Encoding.DER)
        assert (await ask(ready, root)).status_code == 200
        cert.unlink()
        assert (await asyncio.to_thread(shown_at, ready.http_port))[0] == after


async def test_browsers_are_reported_to_stay_only_with_a_certificate_that_the_system_trusts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    authority = Elsewhere()
    root = authority.file(tmp_path)
    cert, key = write_pair(tmp_path / "tls", authority.pair("localhost"))
    async with running_gateway(tmp_path / "one", tls_cert=cert, tls_key=key) as ready:
        assert "strict-transport-security" not in (await ask(ready, root)).headers
    monkeypatch.setenv("SSL_CERT_FILE", str(root))
    async with running_gateway(tmp_path / "two", tls_cert=cert, tls_key=key) as ready:
        assert (await ask(ready, root)).headers["strict-transport-security"] == "max-age=2592000"


def expired(folder: Path) -> tuple[Path, Path]:
    return write_pair(folder, Elsewhere().pair("localhost", now_ns=CLOCK.wall_ns() - 200 * DAY_NS))


def of_another(folder: Path) -> tuple[Path, Path]:
    cert, _ = write_pair(folder, Elsewhere().pair("localhost"))
    _, key = write_pair(folder / "other", Elsewhere().pair("localhost"))
    return cert, key


def encrypted(folder: Path) -> tuple[Path, Path]:
    cert, key = write_pair(folder, Elsewhere().pair("localhost"))
    plain: Any = load_pem_private_key(key.read_bytes(), None)
    key.write_bytes(plain.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, BestAvailableEncryption(b"secret")))
    return cert, key


def swapped(folder: Path) -> tuple[Path, Path]:
    cert, key = write_pair(folder, Elsewhere().pair("localhost"))
    return key, cert


def no_key(folder: Path) -> tuple[Path, Path]:
    cert, key = write_pair(folder, Elsewhere().pair("localhost"))
    key.unlink()
    return cert, key


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (expired, r"--tls-cert .*expired on 20"),
        (of_another, r"--tls-key .*not the key of the first certificate"),
        (encrypted, r"--tls-key .*encrypted"),
        (swapped, r"--tls-cert .*no certificate in PEM"),
        (no_key, r"--tls-key .*No such file"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
async def test_files_that_cannot_serve_are_refused_by_name(
    tmp_path: Path, make: Callable[[Path], tuple[Path, Path]], said: str
) -> None:
    cert, key = make(tmp_path / "tls")
    with pytest.raises(ConfigError, match=said):
        async with running_gateway(tmp_path, tls_cert=cert, tls_key=key):
            pass


def test_the_own_pair_is_followed_and_no_key_stays_on_disk(tmp_path: Path) -> None:
    authority = Elsewhere()
    served = [authority.pair("localhost")]
    tls = HttpTls(lambda: served[-1], None, folder=tmp_path)
    first = tls.context()
    assert tls.context() is first
    served.append(authority.pair("localhost"))
    assert tls.context() is not first
    assert list(tmp_path.iterdir()) == []


async def test_a_robot_without_tls_is_not_received(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, tls="on") as ready:
        agent = ScriptedAgent(ready)
        with pytest.raises(Exception, match="UNAVAILABLE"):
            await agent.open(1)
        await agent.__aexit__()


async def test_the_data_directory_is_this_users_alone(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir(mode=0o755)
    async with running_gateway(tmp_path, tls="on") as ready:
        assert ready.data_dir.stat().st_mode & 0o007 == 0
        for path in (ready.data_dir / name for name in ("local.key", "master.key", "ca-root.key")):
            assert path.stat().st_mode & 0o777 == 0o600
