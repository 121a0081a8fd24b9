"""`metaros robot` against a running gateway: the command it prints, what the list says, the end of an identity."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from gateway.cli_robot import register
from gateway.domain.principal import Role
from tests.gateway.harness import OPERATOR_KEY, ScriptedAgent, client, running_gateway
from tests.gateway.identity.robot_keys import ask, new_key
from tests.support.key_ring import KeyRing


def run(*arguments: str) -> str:
    """A command's output; it must succeed."""
    app = typer.Typer()
    register(app)
    app.command("other")(lambda: None)  # one command alone would have no name
    result = CliRunner().invoke(app, list(arguments))
    assert result.exit_code == 0, (result.output, result.exception)
    return result.output


async def test_token_list_revoke(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ring = KeyRing()
    admin = ring.add(role=Role.ADMIN, name="ada")
    monkeypatch.setenv("METAROS_KEY", admin)
    async with running_gateway(tmp_path, door=ring) as ready:
        at = ("--gateway", ready.url)
        printed = await asyncio.to_thread(run, "robot", "token", "--robot", "arm", "--ttl-min", "5", *at)
        command = next(line for line in printed.splitlines() if line.startswith("metaros agent enrol "))
        assert command.endswith(f" --gateway {ready.url} --name arm")
        made = json.loads(await asyncio.to_thread(run, "robot", "token", *at, "--output", "json"))
        assert made["robot"] == ""
        async with client(ready, key="") as http:
            body = {"token": command.split()[3], "robot": "arm", "csr": ask(new_key())}
            assert (await http.post("/api/v1/enrol", json=body)).status_code == 201
        listed = await asyncio.to_thread(run, "robot", "identities", *at)
        assert "arm" in listed
        assert "active" in listed
        await asyncio.to_thread(run, "robot", "revoke", "arm", "--reason", "lost", *at)
        (found,) = json.loads(await asyncio.to_thread(run, "robot", "identities", *at, "--output", "json"))
        assert (found["state"], found["reason"]) == ("revoked", "lost")


async def test_the_list_is_of_robots_that_connected(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("METAROS_KEY", OPERATOR_KEY)
    async with running_gateway(tmp_path) as ready:
        at = ("--gateway", ready.url)
        assert await asyncio.to_thread(run, "robot", "list", *at) == ""
        async with ScriptedAgent(ready):
            (found,) = json.loads(await asyncio.to_thread(run, "robot", "list", *at, "-o", "json"))
            assert (found["id"], found["state"]) == ("sim_1", "online")
            row = (await asyncio.to_thread(run, "robot", "list", *at)).split()
            assert row[:2] == ["sim_1", "online"]
