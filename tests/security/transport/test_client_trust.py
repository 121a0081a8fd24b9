"""Whom the command line believes at https://: a named file, what a local gateway left, else the system."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from gateway.main import Ready
from gateway.server.announce import LocalAccess
from metaros.access.credentials import ca_for, key_for, local_gateway
from metaros.cli.shared.gateway_http import GatewayClient, open_gateway
from metaros.errors import ConfigError, UnavailableError
from tests.gateway.harness import running_gateway


@pytest.fixture(autouse=True)
def own_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("METAROS_RUNTIME_DIR", str(tmp_path / "run"))
    for name in ("METAROS_KEY", "METAROS_CA", "METAROS_GATEWAY_URL"):
        monkeypatch.delenv(name, raising=False)


async def ask(url: str) -> object:
    """What a command does."""
    return await asyncio.to_thread(lambda: GatewayClient(url).get("/api/v1/users"))


async def test_a_gateway_of_this_machine_needs_no_option_while_it_runs(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, tls="on") as ready:
        access = LocalAccess(ready.data_dir)
        access.begin(ready)
        found = await asyncio.to_thread(lambda: open_gateway("").get("/api/v1/users"))
        assert found == {"users": [], "next": None}
        assert local_gateway() == local_gateway(ready.data_dir) == ready.url
        assert local_gateway(tmp_path / "another") == ""
        assert ca_for(ready.url) == (ready.data_dir / "root.pem").resolve()
        access.end()
        assert (key_for(ready.url), ca_for(ready.url), local_gateway()) == ("", None, "")


async def test_who_is_not_known_is_not_believed_and_the_ways_out_are_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with running_gateway(tmp_path, tls="on") as ready:
        monkeypatch.setenv("METAROS_KEY", (ready.data_dir / "local.key").read_text().strip())
        with pytest.raises(UnavailableError, match=r"not trusted: .*\n.*root\.pem .*--ca root\.pem") as refused:
            await ask(ready.url)
        assert len(str(refused.value).splitlines()) == 2
        monkeypatch.setenv("METAROS_CA", str(ready.data_dir / "root.pem"))
        assert await ask(ready.url) == {"users": [], "next": None}
        with pytest.raises(UnavailableError, match=r"is not for '127\.1'\n.*--allow-host 127\.1"):
            await ask(ready.url.replace("127.0.0.1", "127.1"))
        with pytest.raises(Exception, match="TLS"):
            await ask(ready.url.replace("https", "http"))
        for missing, said in ((tmp_path / "none.pem", "No such file"), (ready.data_dir / "local.key", "no PEM")):
            monkeypatch.setenv("METAROS_CA", str(missing))
            with pytest.raises(ConfigError, match=said):
                await ask(ready.url)


async def test_a_named_root_alone_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with (
        running_gateway(tmp_path / "one", tls="on") as one,
        running_gateway(tmp_path / "two", tls="on") as two,
    ):
        monkeypatch.setenv("SSL_CERT_FILE", str(one.data_dir / "root.pem"))  # even if the system knows it
        monkeypatch.setenv("METAROS_CA", str(two.data_dir / "root.pem"))
        with pytest.raises(UnavailableError, match="not trusted"):
            await ask(one.url)


def test_entries_of_killed_gateways_make_room_first(tmp_path: Path) -> None:
    def ready(number: int) -> Ready:
        return Ready("127.0.0.1", number, 1, tmp_path / str(number))

    live = LocalAccess(tmp_path / "1")
    (tmp_path / "1").mkdir()
    (tmp_path / "1" / "local.key").write_text("mrk_x")
    live.begin(ready(1))
    for number in range(2, 200):
        LocalAccess(tmp_path / str(number)).begin(ready(number))
    assert key_for("http://127.0.0.1:1") == "mrk_x"
