"""`metaros update` and `metaros rollout` against a real gateway, with the offline half in a folder."""

from __future__ import annotations

import json
from pathlib import Path

from gateway.domain.principal import Role
from gateway.main import Ready
from tests.gateway.harness import CONTROL, RING, ScriptedAgent, running_gateway
from tests.support.deployment.bundles import make_bundle
from tests.support.processes.command_line import Done, ask_metaros

ADMIN = RING.add(role=Role.ADMIN, name="cli admin")


async def metaros(ready: Ready | None, *arguments: str, folder: Path) -> Done:
    """Run it in that folder."""
    url = ready.url if ready is not None else "http://127.0.0.1:9"
    environ = {"METAROS_KEY": ADMIN, "METAROS_GATEWAY_URL": url, "http_proxy": "http://127.0.0.1:9"}
    return await ask_metaros(*arguments, folder=folder, **environ)


async def test_from_keys_to_a_rollout(tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_text("correct horse\n")
    make_bundle(tmp_path, name="metaros", kind="agent", version="2.0.0", members={"wheels/m-2-py3-none-any.whl": b"2"})
    asked = ("--passphrase-file", str(secret))
    async with running_gateway(tmp_path, heartbeat_s=60.0) as ready, ScriptedAgent(ready, "sim_1") as agent:

        async def run(*arguments: str, offline: bool = False) -> str:
            code, out, err = await metaros(None if offline else ready, *arguments, folder=tmp_path)
            assert code == 0, (arguments, out, err)
            assert "correct horse" not in out + err
            return out

        (tmp_path / "online.json").write_text(await run("update", "online-keys"))
        said = await run("update", "init-root", "people", "--online", "online.json", *asked, offline=True)
        assert said.startswith("root 1 in people")
        added = await run("update", "add", "people", "metaros-2.0.0.zip", offline=True)
        assert added == "agents/metaros/2.0.0.zip\n"
        said = await run("update", "sign", "people", *asked, offline=True)
        assert said.startswith("targets 1: 1 target, until ")
        assert await run("update", "publish", "people") == "root 1, snapshot 1, targets 1, timestamp 1\n"
        listed = json.loads(await run("update", "list", "-o", "json"))
        assert [(one["path"], one["signed"]) for one in listed["bundles"]] == [("agents/metaros/2.0.0.zip", True)]
        assert "signed" in await run("update", "list")

        dry = await run("rollout", "start", "2.0.0", "--all", "--dry-run")
        assert dry.startswith("(dry run) ")
        assert json.loads(await run("rollout", "list", "-o", "json")) == []
        begun = json.loads(
            await run("rollout", "start", "2.0.0", "-l", "robot=sim_1", "--waves", "1,100%", "-o", "json")
        )
        rid = begun["id"]
        assert (begun["selector"], begun["robots"]) == ("robot=sim_1", 1)
        await agent.send(CONTROL, twin={"state": "applied", "reported": b'{"agent": {"version": "1.0.0"}}'})
        desired = json.loads((await agent.next("twin")).twin.document)
        assert desired == {"agent": {"version": "2.0.0"}}
        assert (await run("rollout", "pause", rid)).endswith(": paused\n")
        assert (await run("rollout", "resume", rid)).endswith(": running\n")
        assert f"{rid}  metaros 2.0.0  running  1/1" in await run("rollout", "list")
        shown = await run("rollout", "show", rid)
        assert "metaros 2.0.0: running" in shown
        assert "sim_1  updating" in shown
        found = json.loads(await run("rollout", "show", rid, "-o", "json"))
        assert (found["id"], found["state"], found["members"][0]["robot"]) == (rid, "running", "sim_1")
        assert (await run("rollout", "abort", rid, "--reason", "enough")).endswith(": aborted\n")

        await run("update", "sign", "people", "root", "--rotate", "--replace", "root-2", *asked, offline=True)
        said = await run("update", "sign", "people", "root", "--key", "root-1", "--key", "root-3", *asked, offline=True)
        assert said == "root: signed by enough keys\n"
        assert (await run("update", "publish", "people")).startswith("root 2, ")
        await run("update", "withdraw", "agents/metaros/2.0.0.zip", "--reason", "late")
        assert "withdrawn" in await run("update", "list")
        code, _, err = await metaros(ready, "rollout", "start", "2.0.0", "--all", folder=tmp_path)
        assert code != 0
        assert "withdrawn" in err


async def test_what_is_not_understood(tmp_path: Path) -> None:
    (tmp_path / "junk.zip").write_bytes(b"PK")
    (tmp_path / "short").write_text("1234567\n")
    (tmp_path / "online.json").write_text("[]")
    for arguments, said in (
        (("update", "init-root", "people"), "--online FILE is needed"),
        (("update", "init-root", "people", "--online", "online.json"), "holds no keys"),
        (("update", "add", "people", "junk.zip"), "no bundle"),
        (("update", "sign", "people", "targets", "--rotate"), "of root alone"),
        (("update", "sign", "people", "root", "--replace", "root-1"), "add --rotate"),
        (("update", "publish", "people"), "nothing signed"),
        (("rollout", "start", "2.0.0"), "say which robots"),
        (("rollout", "start", "2.0.0", "--all", "-l", "a=b"), "say which robots"),
    ):
        code, _, err = await metaros(None, *arguments, folder=tmp_path)
        assert code != 0, arguments
        assert said in err, (arguments, err)
        assert "Traceback" not in err
