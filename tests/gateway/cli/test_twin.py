"""`metaros twin` and `metaros robot label` against a running gateway."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gateway.domain.principal import Role
from tests.gateway.harness import ScriptedAgent, running_gateway
from tests.support.gateways.memory_authenticator import KeyRing
from tests.support.processes.command_line import ask_metaros


async def cli(*arguments: str, stdin: str = "") -> str:
    """All that a command says; it has to end well."""
    done = await ask_metaros(*arguments, stdin=stdin)
    assert done.code == 0, done.err
    return done.out + done.err


async def refusal(*arguments: str) -> str:
    """What a command that fails says."""
    done = await ask_metaros(*arguments)
    assert done.code in (1, 2), done.out
    return done.err


async def test_show_patch_diff_history_revert(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ring = KeyRing()
    monkeypatch.setenv("METAROS_KEY", ring.add(role=Role.ADMIN, name="ada"))
    async with (
        running_gateway(tmp_path, authenticator=ring) as ready,
        ScriptedAgent(ready, "a1"),
        ScriptedAgent(ready, "a2"),
    ):
        monkeypatch.setenv("METAROS_GATEWAY_URL", ready.url)
        patch = '{"budget": {"bytes_per_s": 5000}}'
        tried = await cli("twin", "patch", "a1", patch, "--dry-run")
        assert '+ /budget: {"bytes_per_s": 5000}' in tried
        assert "a1 would be at revision 1" in tried
        assert "a1 is at revision 1" in await cli("twin", "patch", "a1", "-", "--reason", "slow", stdin=patch)
        assert "budget.bytes_per_s: 0, or 1000 to" in await refusal(
            "twin", "patch", "a1", '{"budget": {"bytes_per_s": 5}}'
        )
        (tmp_path / "own.json").write_text('{"nodes": {"lidar": {"allowed": "lidar"}}}')
        assert "at 1.1 by now" in await refusal("twin", "set", "a1", str(tmp_path / "own.json"), "--if-revision", "0")
        assert '- /budget: {"bytes_per_s": 5000}' in await cli("twin", "diff", "a1", str(tmp_path / "own.json"))
        await cli("twin", "set", "a1", str(tmp_path / "own.json"), "--if-revision", "1")
        shown = json.loads(await cli("twin", "show", "a1", "-o", "json"))
        assert (shown["revision"], shown["author"]) == (2, "ada")
        history = await cli("twin", "history", "a1")
        assert "1.1  " in history
        assert "slow" in history
        assert "a1 is at revision 3" in await cli("twin", "revert", "a1", "1")
        assert "a1 is at revision 4" in await cli("twin", "retry", "a1")
        assert '+ /budget: {"bytes_per_s": 5000}' in await cli("twin", "diff", "a1")
        await cli("robot", "label", "a1", "site=lab", "kind=arm")
        await cli("robot", "label", "a1", "kind-")
        assert await cli("robot", "label", "a1") == "site=lab\n"
        assert "LABEL=VALUE" in await refusal("robot", "label", "a1", "nonsense")
        reported = await cli("twin", "template", "set", "cams", '{"topics": {"cam": {"rate_hz": 2}}}', "-l", "site=lab")
        assert "changed: 1 robot of 1" in reported
        assert "site=lab" in await cli("twin", "template", "list")
        assert '"rate_hz": 2' in await cli("twin", "template", "show", "cams")
        many = await cli("twin", "patch", '{"agent": {"version": "2.1.0"}}', "-l", "robot in (a1, a2)", "-o", "json")
        assert [item["robot"] for item in json.loads(many)["results"]] == ["a1", "a2"]
        (row,) = json.loads(await cli("twin", "show", "-l", "site", "-o", "json"))
        assert row["robot"] == "a1"
        assert "a2" in await cli("twin", "show")
        assert "would change: 1 robot" in await cli("twin", "template", "remove", "cams", "--dry-run")
        await cli("twin", "template", "remove", "cams")
        assert json.loads(await cli("twin", "template", "list", "-o", "json")) == []
        reported = await cli("twin", "template", "history", "cams")
        assert "removed" in reported
        assert "+ /topics" in reported
        made = json.loads(await cli("twin", "template", "history", "cams", "-o", "json"))[-1]["revision"]
        assert "would change: 1 robot" in await cli("twin", "template", "revert", "cams", str(made), "--dry-run")
        await cli("twin", "template", "revert", "cams", str(made))
        assert "site=lab" in await cli("twin", "template", "list")
        await cli("twin", "template", "remove", "cams")
        assert "say a robot and a patch" in await refusal("twin", "patch", "{}")
