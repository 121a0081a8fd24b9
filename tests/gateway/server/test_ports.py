"""Which ports a gateway has: its own ones for viewers' protocols, moved when taken, and none where nobody wants one."""

from __future__ import annotations

import asyncio
import json
import logging
import socket
from pathlib import Path

import httpx
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from gateway.server.announce import ready_line, write_status
from gateway.server.ports import NO_PORT, PortChoice, listen_all, port_of
from gateway.settings import Settings
from metaros.errors import ConfigError
from tests.gateway.harness import OPERATOR_KEY, running_gateway


def test_all_ports_are_had_or_none(free_port: int) -> None:
    chosen = [PortChoice(0, 1, "--port"), PortChoice(NO_PORT, 1, "--foxglove-port")]
    with listen_all("127.0.0.1", chosen) as (main, none):
        assert port_of(main) > 0
        assert (none, port_of(none)) == (None, 0)
    with socket.create_server(("127.0.0.1", free_port)):
        taken = PortChoice(free_port, 1, "--rosbridge-port")
        with pytest.raises(ConfigError, match="--rosbridge-port"), listen_all("127.0.0.1", [*chosen, taken]):
            pass
        with listen_all("127.0.0.1", [PortChoice(None, free_port, "--foxglove-port")]) as (moved,):
            assert port_of(moved) not in (0, free_port)


async def test_viewers_ports_are_reported(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready:
        assert len({ready.http_port, ready.foxglove_port, ready.rosbridge_port}) == 3
        assert ready.foxglove_url == f"ws://127.0.0.1:{ready.foxglove_port}"
        line = ready_line(Settings(data_dir=tmp_path, foxglove_port=0, rosbridge_port=0), ready)
        assert f"foxglove 127.0.0.1:{ready.foxglove_port}  rosbridge 127.0.0.1:{ready.rosbridge_port}" in line
        write_status(tmp_path / "status.json", ready)
        status = json.loads((tmp_path / "status.json").read_text())
        assert (status["foxglove_port"], status["rosbridge_port"]) == (ready.foxglove_port, ready.rosbridge_port)


async def test_a_browser_that_looks_there_is_reported_what_it_is(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, httpx.AsyncClient(trust_env=False) as http:
        for port, name in ((ready.foxglove_port, "Foxglove"), (ready.rosbridge_port, "rosbridge")):
            answer = await http.get(f"http://127.0.0.1:{port}/")
            assert answer.status_code == 426
            assert name in answer.text
            assert (await http.get(f"http://127.0.0.1:{port}/api/v1/robots")).status_code == 426


async def test_ports_can_be_off(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, foxglove_port=NO_PORT, rosbridge_port=NO_PORT) as ready:
        assert (ready.foxglove_port, ready.rosbridge_port) == (0, 0)
        assert ready.foxglove_url == f"ws://127.0.0.1:{ready.http_port}/foxglove"
        line = ready_line(Settings(data_dir=tmp_path, foxglove_port=NO_PORT, rosbridge_port=NO_PORT), ready)
        assert "foxglove" not in line.replace(str(tmp_path), "")


async def test_a_token_in_the_url_is_in_no_log(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG)
    async with running_gateway(tmp_path) as ready:
        stream = f"ws://127.0.0.1:{ready.http_port}/api/v1/stream?x=1&token="
        async with connect(f"{stream}{OPERATOR_KEY}", proxy=None) as viewer:
            assert json.loads(await asyncio.wait_for(viewer.recv(), 60))["op"] == "welcome"
        with pytest.raises(InvalidStatus):
            await connect(f"{stream}mrk_wrong", proxy=None)
    ours = [record.getMessage() for record in caplog.records if not record.name.startswith("websockets.client")]
    assert not [line for line in ours if OPERATOR_KEY in line or "mrk_wrong" in line]
