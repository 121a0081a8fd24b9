"""`metaros robot` against a running gateway: the command it prints, what the list says, the end of an identity."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gateway.domain.principal import Role
from tests.gateway.harness import OPERATOR_KEY, ScriptedAgent, client, running_gateway
from tests.gateway.identity.robot_keys import ask, new_key
from tests.support.gateways.memory_authenticator import KeyRing
from tests.support.processes.command_line import ask_metaros


async def cli(*arguments: str) -> str:
    """All that a command says; it has to end well."""
    done = await ask_metaros("robot", *arguments)
    assert done.code == 0, done.err
    return done.out + done.err


async def test_token_list_revoke(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ring = KeyRing()
    admin = ring.add(role=Role.ADMIN, name="ada")
    monkeypatch.setenv("METAROS_KEY", admin)
    async with running_gateway(tmp_path, authenticator=ring) as ready:
        at = ("--gateway", ready.url)
        printed = await cli("token", "--robot", "arm", "--ttl-min", "5", *at)
        command = next(line for line in printed.splitlines() if line.startswith("metaros agent enrol "))
        assert command.endswith(f" --gateway {ready.url} --name arm")
        made = json.loads(await cli("token", *at, "--output", "json"))
        assert made["robot"] == ""
        async with client(ready, key="") as http:
            body = {"token": command.split()[3], "robot": "arm", "csr": ask(new_key())}
            assert (await http.post("/api/v1/enrol", json=body)).status_code == 201
        listed = await cli("identities", *at)
        assert "arm" in listed
        assert "active" in listed
        await cli("revoke", "arm", "--reason", "lost", *at)
        (found,) = json.loads(await cli("identities", *at, "--output", "json"))
        assert (found["state"], found["reason"]) == ("revoked", "lost")


async def test_the_list_is_of_robots_that_connected(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("METAROS_KEY", OPERATOR_KEY)
    async with running_gateway(tmp_path) as ready:
        at = ("--gateway", ready.url)
        assert await cli("list", *at) == ""
        async with ScriptedAgent(ready):
            (found,) = json.loads(await cli("list", *at, "-o", "json"))
            assert (found["id"], found["state"]) == ("sim_1", "online")
            row = (await cli("list", *at)).split()
            assert row[:2] == ["sim_1", "online"]
