"""`metaros command` against a real gateway with scripted robots."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

from gateway.main import Ready
from tests.gateway.harness import OPERATOR_KEY, ScriptedAgent, running_gateway
from tests.support.processes.command_line import Done, ask_metaros


async def metaros(ready: Ready, *arguments: str) -> Done:
    """Run it."""
    return await ask_metaros("command", *arguments, METAROS_GATEWAY_URL=ready.url, METAROS_KEY=OPERATOR_KEY)


async def test_send_list_show_cancel_and_what_is_no_command(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready:
        async with ScriptedAgent(ready) as agent, ScriptedAgent(ready, "sim_2", session=b"2" * 16):
            sending = asyncio.create_task(
                metaros(ready, "send", "set_uplink", "bytes_per_s=5000", "--robot", "sim_1", "-o", "json")
            )
            asked = (await agent.next("command")).command
            assert asked.set_uplink.bytes_per_s == 5000
            await agent.answer(asked)
            code, out, err = await sending
            assert code == 0, err
            assert [item["state"] for item in json.loads(out)["commands"]] == ["done"]
        named = ("send", "set_uplink", "bytes_per_s=null", "-l", "robot in (sim_1, sim_2)", "--durable", "--expires")
        assert (await metaros(ready, *named, "2d", "--dry-run"))[1].split() == ["sim_1", "sim_2"]
        code, out, err = await metaros(ready, *named, "2d")
        assert (code, out.count("issued")) == (0, 2), err
        code, out, _ = await metaros(ready, "list", "--state", "issued", "-o", "json")
        found = json.loads(out)
        # They were sent at once: neither of the two is the newer one.
        assert sorted((item["robot"], item["request"]) for item in found) == [
            ("sim_1", {"bytes_per_s": None}),
            ("sim_2", {"bytes_per_s": None}),
        ]
        assert (await metaros(ready, "cancel", found[0]["id"]))[0] == 0
        code, out, _ = await metaros(ready, "show", found[0]["id"])
        assert "cancelled" in out
        code, _, err = await metaros(ready, "cancel", found[0]["id"])
        assert code != 0
        assert "cancelled" in err
        for arguments, reported in (
            (("send", "set_uplink", "-r", "a", "-l", "b"), "--robot"),
            (("send", "set_uplink", "5", "-r", "a"), "FIELD=VALUE"),
            (("send", "set_uplink", "bytes_per_s=1", "-r", "a", "--durable", "--expires", "soon"), "span"),
            (("send", "set_uplink", "bytes_per_s=1", "-r", "nobody"), "nobody"),
        ):
            code, _, err = await metaros(ready, *arguments)
            assert code != 0
            assert reported in err
