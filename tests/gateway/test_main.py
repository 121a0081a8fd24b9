"""The program: settings, ports, a second gateway. Its start as a process, and its end, are in test_systemd.py."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Any

import pytest

from gateway.server.ports import listen
from gateway.settings import Settings
from gateway.wiring.options import function_choices
from metaros.errors import ConfigError
from tests.gateway.harness import client, running_gateway


def test_settings_refuse_what_cannot_be() -> None:
    for host in ("0.0.0.0", "::", "192.168.1.5", "example.org"):
        assert Settings(host=host).tls_on
        with pytest.raises(ConfigError, match="--trusted-proxy"):
            Settings(host=host, tls="off")
    for host in ("127.0.0.1", "127.0.0.9", "::1", "localhost"):
        assert Settings(host=host).host == host
    with pytest.raises(ConfigError):
        Settings(retention_days=0)
    for egress, allowed in (("any", True), ("none", False), ("*.example:443", True), ("*.other", False)):
        bound = function_choices(Settings(function_egress=egress)).egress
        assert (bound is None or bound.check("api.example", 443) is not None) == allowed
    for egress, here in (("any", True), ("public", False), ("public, 127.0.0.1:8080", True)):
        bound = function_choices(Settings(function_egress=egress)).egress
        reach = bound.check("127.0.0.1", 8080) if bound is not None else lambda address: True
        assert (reach is not None and reach("127.0.0.1")) == here
    public = function_choices(Settings()).egress
    assert public is not None
    reach = public.check("db.example", 5432)
    assert reach is not None
    assert (reach("93.184.216.34"), reach("10.0.0.7"), reach("169.254.169.254")) == (True, False, False)
    with pytest.raises(ConfigError, match="--function-egress: 'https://a' is no pattern"):
        Settings(function_egress="any.example, https://a")


def test_an_asked_port_is_had_or_names_its_owner(free_port: int) -> None:
    with socket.create_server(("127.0.0.1", free_port)):
        with pytest.raises(ConfigError, match=rf"port {free_port} .*python.*pid"):
            listen("127.0.0.1", free_port, default=1, flag="--port")
        moved = listen("127.0.0.1", None, default=free_port, flag="--port")
        assert moved.getsockname()[1] != free_port
        moved.close()


async def test_a_second_gateway_gets_its_own_ports_or_says_no(tmp_path: Path) -> None:
    async with running_gateway(tmp_path / "one") as first:
        with pytest.raises(ConfigError, match="another gateway"):
            async with running_gateway(tmp_path / "one"):
                pass
        async with running_gateway(tmp_path / "two") as second, client(second) as http:
            assert {first.http_port, first.grpc_port}.isdisjoint({second.http_port, second.grpc_port})
            assert (await http.get("/readyz")).status_code == 200


async def test_a_taken_robots_port_is_an_error(tmp_path: Path, free_port: int) -> None:
    with socket.create_server(("127.0.0.1", free_port)):
        with pytest.raises(ConfigError, match=f"port {free_port} cannot be opened"):
            async with running_gateway(tmp_path, grpc_port=free_port):
                pass


@pytest.mark.parametrize("flag", ["grpc_port", "api_grpc_port"])
async def test_somebody_quicker_takes_the_default_port(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, flag: str
) -> None:
    """Two gateways that start at once find the same default port free; the one that comes second takes another."""
    with socket.create_server(("127.0.0.1", 0)) as quicker:
        taken = quicker.getsockname()[1]

        def late(host: str, port: int | None, **rest: Any) -> socket.socket:
            return quicker.dup() if port is None else listen(host, port, **rest)

        monkeypatch.setattr("gateway.main.listen", late)
        async with running_gateway(tmp_path, **{flag: None}) as ready:
            assert getattr(ready, flag) not in (0, taken)
            async with client(ready) as http:
                assert (await http.get("/readyz")).status_code == 200
