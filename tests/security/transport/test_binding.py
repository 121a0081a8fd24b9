"""Listening beyond this machine: refused with the way out, and what holds when it is allowed."""

from __future__ import annotations

import asyncio
import json
import os
import shlex
import ssl
import sys
from pathlib import Path
from typing import Any

import grpc
import httpx
import pytest

from gateway.domain.host_names import machine_names, outward_address
from gateway.main import serve
from gateway.settings import Settings
from metaros._proto import link_pb2, link_pb2_grpc
from metaros.errors import ConfigError
from tests.gateway.harness import client, running_gateway
from tests.support.gateways.plain_http import TRUSTS_NOBODY
from tests.support.gateways.quick_passwords import quick_passwords  # noqa: F401 - a fixture
from tests.support.processes.command_line import ask_metaros, call_metaros
from tests.support.processes.processes import started
from tests.support.servers.postgres import PostgresServer
from tests.support.waiting import wait_until

HERE = outward_address()
reachable = pytest.mark.skipif(not HERE, reason="this machine has no address but loopback")


async def refusal(**settings: Any) -> str:
    """Why a gateway does not start."""
    with pytest.raises(ConfigError) as refused:
        await serve(Settings(port=0, grpc_port=0, **settings), asyncio.Event())
    return str(refused.value)


async def run(command: str, home: Path) -> str:
    """A printed command, as somebody copies it."""
    done = await ask_metaros(*shlex.split(command)[1:], HOME=str(home))
    assert done.code == 0, done.err
    return done.out


def commands(text: str) -> list[str]:
    """The commands of a message."""
    return [line.strip() for line in text.splitlines() if line.startswith("  metaros ")]


@pytest.mark.parametrize("host", ["0.0.0.0", "::"])
async def test_without_anybody_who_can_sign_in_the_refusal_says_the_way_out(tmp_path: Path, host: str) -> None:
    text = await refusal(host=host, data_dir=tmp_path / "my data")
    assert text.splitlines()[0] == f"--host {host}: other machines can connect there, and nobody can sign in yet"
    add, link = commands(text)
    assert "ada: admin" in await run(add, tmp_path)
    assert "/signin#" in await run(link, tmp_path)
    stop = asyncio.Event()
    settings = Settings(host=host, port=0, grpc_port=0, data_dir=tmp_path / "my data")
    await serve(settings, stop, on_ready=lambda _: stop.set())


async def test_the_way_out_works_on_postgresql(tmp_path: Path, postgres: PostgresServer) -> None:
    url = postgres.schema()
    text = await refusal(host="0.0.0.0", data_dir=tmp_path / "data", store_url=url)
    add, _ = commands(text)
    assert "ada: admin" in await run(add, tmp_path)
    stop = asyncio.Event()
    settings = Settings(host="0.0.0.0", port=0, grpc_port=0, data_dir=tmp_path / "data", store_url=url)
    await serve(settings, stop, on_ready=lambda _: stop.set())


async def test_who_counts_as_somebody(tmp_path: Path) -> None:
    where = tmp_path / "data"
    for made in ("key create --name k --role operator", "user add bob --role operator"):
        await run(f"metaros {made} --data-dir {where}", tmp_path)
        assert "nobody can sign in" in await refusal(host="0.0.0.0", data_dir=where), made
    for number, made in enumerate(("key create --name k --role admin", "user add bob --role admin")):
        where = tmp_path / str(number)
        await run(f"metaros {made} --data-dir {where}", tmp_path)
        stop = asyncio.Event()  # a harness' gateway would not ask its store: it has an endpoint of its own
        settings = Settings(host="0.0.0.0", port=0, grpc_port=0, data_dir=where)
        await serve(settings, stop, on_ready=lambda _, stop=stop: stop.set())


async def test_without_tls_a_proxy_has_to_be_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"--tls off(.|\n)*--trusted-proxy"):
        Settings(host="0.0.0.0", tls="off", data_dir=tmp_path)
    with pytest.raises(ConfigError, match="everybody"):
        Settings(host="0.0.0.0", tls="off", trusted_proxies=("0.0.0.0/0",), data_dir=tmp_path)
    Settings(host="0.0.0.0", tls="off", trusted_proxies=("10.0.0.0/8",), data_dir=tmp_path)


@reachable
async def test_a_wildcards_names_and_whom_it_knows(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, host="0.0.0.0", allow_hosts=("fleet.example",)) as ready:
        context = ssl.create_default_context(cadata=ready.roots_pem)
        async with httpx.AsyncClient(verify=context, trust_env=False) as http:
            url = f"https://{HERE}:{ready.http_port}/healthz"
            assert (await http.get(url)).status_code == 200  # the address is in the certificate, too
            for name in (*machine_names(), "fleet.example"):
                host = f"[{name}]" if ":" in name else name
                assert (await http.get(url, headers={"Host": f"{host}:{ready.http_port}"})).status_code == 200, name
            for name in ("evil.example", "203.0.113.5", "0.0.0.0"):
                answer = await http.get(url, headers={"Host": name})
                assert (answer.status_code, answer.json()["code"]) == (403, "host_not_allowed"), name

        for loopback in ("127.0.0.1", "localhost"):  # knows no anonymous viewer, as no other address does
            async with client(ready, key="") as http:
                http.base_url = httpx.URL(f"https://{loopback}:{ready.http_port}")
                answer = await http.get("/api/v1/robots")
                assert (answer.status_code, answer.json()["code"]) == (401, "sign_in")
                assert (await http.get("/api/v1/auth/me")).json().get("role", "none") == "none"


@reachable
async def test_a_token_made_over_loopback_names_an_address_that_robots_reach(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, host="0.0.0.0") as ready:
        async with client(ready, key=(ready.data_dir / "local.key").read_text().strip()) as http:
            made = await http.post("/api/v1/enrolment-tokens", json={"robot": "arm_1"})
        assert f"--gateway https://{HERE}:{ready.http_port} " in made.json()["command"]


@reachable
async def test_without_tls_others_than_the_proxy_get_nothing_but_the_probes(tmp_path: Path) -> None:
    options: dict[str, Any] = {"host": "0.0.0.0", "tls": "off", "trusted_proxies": ("127.0.0.1",)}
    plain = httpx.AsyncClient(verify=TRUSTS_NOBODY, trust_env=False)
    async with running_gateway(tmp_path, **options) as ready, plain as http:
        direct = f"http://{HERE}:{ready.http_port}"
        for path in ("/", "/api/v1/robots", "/api/v1/auth/me"):
            answer = await http.get(direct + path, headers={"X-Forwarded-For": "127.0.0.1"})
            assert (answer.status_code, answer.json()["code"]) == (403, "proxy_only")
        for path in ("/healthz", "/readyz"):
            assert (await http.get(direct + path)).status_code == 200
        by_proxy = {"X-Forwarded-For": "198.51.100.7", "X-Forwarded-Proto": "https"}
        with pytest.raises(grpc.aio.AioRpcError, match="UNAVAILABLE"):  # robots' port keeps its TLS
            async with grpc.aio.insecure_channel(f"127.0.0.1:{ready.grpc_port}") as robots:
                await link_pb2_grpc.LinkStub(robots).Connect(iter([link_pb2.AgentFrame()])).read()
        answer = await http.get(f"{ready.url}/api/v1/robots", headers=by_proxy)
        assert (answer.status_code, answer.json()["code"]) == (401, "sign_in")


async def test_on_loopback_a_trusted_proxys_people_are_no_anonymous_viewers(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, trusted_proxies=("127.0.0.1",)) as ready, client(ready, key="") as http:
        for headers in ({}, {"X-Forwarded-For": "127.0.0.1"}, {"X-Forwarded-For": "198.51.100.7"}):
            assert (await http.get("/api/v1/robots", headers=headers)).status_code == 401


@pytest.mark.usefixtures("quick_passwords")
async def test_the_lock_out_and_the_log_know_the_client_behind_the_proxy(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, trusted_proxies=("127.0.0.1",)) as ready:
        admin = (ready.data_dir / "local.key").read_text().strip()
        async with client(ready, key="", origin=ready.url) as http:
            wrong = {"name": "ada", "password": "wrong wrong wrong"}
            seen = {"X-Forwarded-For": "6.6.6.6, 198.51.100.7", "X-Forwarded-Proto": "https"}
            assert (await http.post("/api/v1/auth/login", json=wrong, headers=seen)).status_code == 401

        def addresses() -> set[str]:
            url, headers = f"{ready.url}/api/v1/audit?action=sessions.open", {"Authorization": f"Bearer {admin}"}
            answer = httpx.get(url, headers=headers, verify=TRUSTS_NOBODY, trust_env=False, timeout=60)
            return {row["address"] for row in answer.json()["rows"]}

        await asyncio.to_thread(wait_until, addresses)
        assert await asyncio.to_thread(addresses) == {"198.51.100.7"}


@pytest.mark.integration
def test_the_program_says_it_and_writes_no_more_than_that(tmp_path: Path) -> None:
    words = ["gateway", "--host", "0.0.0.0", "--port", "0", "--grpc-port", "0"]
    done = call_metaros(*words, HOME=str(tmp_path))
    assert done.code == 2
    assert done.err.startswith("error: --host 0.0.0.0: other machines can connect there")
    add, _ = commands(done.err)
    assert call_metaros(*shlex.split(add)[1:], HOME=str(tmp_path)).code == 0
    status = tmp_path / "status.json"
    command = [sys.executable, "-m", "metaros", *words, "--status-file", str(status)]
    with started(command, env={**os.environ, "HOME": str(tmp_path)}) as process:
        wait_until(lambda: status.exists() or process.poll() is not None)
        assert json.loads(status.read_text())["url"].startswith("https://127.0.0.1:")
