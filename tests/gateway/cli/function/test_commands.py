"""`metaros function` and `metaros rule` against a real gateway that runs functions."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from gateway.domain.principal import Role
from tests.gateway.harness import RING, running_gateway
from tests.support.processes.command_line import ask_metaros

CHIEF = RING.add(role=Role.ADMIN, name="chief")
GUEST = RING.add(role=Role.VIEWER, name="guest")
HANDLER = """
import os

def handler(event, context):
    print("asked for", event.get("n"))
    if event.get("n") == 13:
        raise ValueError("not thirteen")
    return {"doubled": event.get("n", 0) * 2, "mood": os.environ.get("MOOD", "")}
"""


@dataclass
class Shell:
    """A command line beside a gateway."""

    url: str
    folder: Path
    key: str = CHIEF

    @property
    def environ(self) -> dict[str, str]:
        """Of a program that asks this gateway."""
        here = {"METAROS_GATEWAY_URL": self.url, "METAROS_KEY": self.key, "http_proxy": "http://127.0.0.1:9"}
        return {**here, "NO_COLOR": "1"}

    async def ask(self, *arguments: str, stdin: str = "") -> tuple[int, str, str]:
        """Its exit code and what it says; a traceback is never said."""
        code, out, err = await ask_metaros(*arguments, folder=self.folder, stdin=stdin, **self.environ)
        assert "\nTraceback (most" not in f"\n{err}", err
        return code, out, err

    async def run(self, *arguments: str, stdin: str = "") -> str:
        """What it prints; it ends well."""
        code, out, err = await self.ask(*arguments, stdin=stdin)
        assert code == 0, (arguments, out, err)
        return out

    async def read(self, *arguments: str) -> Any:
        """The same as JSON."""
        return json.loads(await self.run(*arguments, "-o", "json"))


@asynccontextmanager
async def shell(folder: Path) -> AsyncIterator[Shell]:
    """A gateway, and a command line in a folder with a function."""
    code = folder / "double"
    code.mkdir()
    (code / "app.py").write_text(HANDLER)
    async with running_gateway(folder / "gateway") as ready:
        yield Shell(ready.url, folder)


async def until(at: Shell, *arguments: str, good: Any) -> Any:
    """What a command shows once it is good, within a minute."""
    async with asyncio.timeout(60):
        while True:  # each look is a process of its own, and takes its time
            if good(found := await at.read(*arguments)):
                return found


@pytest.mark.integration
async def test_a_function_from_its_code_to_its_end(tmp_path: Path) -> None:
    async with shell(tmp_path) as at:
        code, out, err = await at.ask("function", "deploy", "double", "--env", "MOOD=good", "--timeout", "5s")
        assert (code, out) == (0, "✓ double: made\n")
        assert "packed    1 file" in err
        assert json.loads(await at.run("function", "invoke", "double", "-d", '{"n": 21}')) == {
            "doubled": 42,
            "mood": "good",
        }
        (tmp_path / "in.json").write_text('{"n": 2}')
        assert (await at.read("function", "invoke", "double", "-d", "@in.json"))["payload"]["doubled"] == 4
        assert '"doubled": 6' in await at.run("function", "invoke", "double", "-d", "-", stdin='{"n": 3}')
        code, out, err = await at.ask("function", "invoke", "double", "-d", '{"n": 13}', "--tail")
        assert code == 1
        assert out.startswith("ValueError: not thirteen\n")
        assert "│ asked for 13" in err
        (row,) = await at.read("function", "list")
        assert (row["timeout_s"], row["memory_mb"], row["handler"]) == (5, 128, "app.handler")
        assert (await at.run("function", "list")).split()[:2] == ["double", "app.handler"]
        shown = await at.run("function", "show", "double")
        assert "variables  MOOD" in shown
        assert "asked for 21" in await at.run("function", "logs", "double")
        calls = await until(at, "function", "invocations", "double", good=lambda found: len(found) == 4)
        assert [one["status"] for one in calls] == ["error", "ok", "ok", "ok"]
        assert (await at.run("function", "code", "double")).split() == ["app.py", f"{len(HANDLER)}", "B"]
        assert (await at.run("function", "code", "double", "app.py")).strip() == HANDLER.strip()
        runtime = await at.read("function", "runtime")
        assert runtime["started"]
        assert f"\n  ✓ {runtime['level']}  " in await at.run("function", "runtime")
        assert await at.run("function", "delete", "double") == "double: deleted\n"
        code, _, err = await at.ask("function", "show", "double")
        assert code == 1
        assert "double" in err


@pytest.mark.integration
async def test_versions_aliases_and_a_canary(tmp_path: Path) -> None:
    async with shell(tmp_path) as at:
        out = await at.run("function", "deploy", "double", "--alias", "live", "--reserved", "3", "--on-success", "bus")
        assert out == "✓ double: made, version 1, live leads to it\n"
        out = await at.run("function", "deploy", "double", "--publish")
        assert out == "✓ double: the same code as before, version 1\n"
        (tmp_path / "double" / "app.py").write_text(HANDLER.replace("* 2", "* 3"))
        assert await at.run("function", "deploy", "double", "--publish") == "✓ double: changed, version 2\n"
        assert [one["version"] for one in await at.read("function", "versions", "double")] == ["1", "2"]
        out = await at.run("function", "invoke", "double", "-d", '{"n": 1}', "--qualifier", "live")
        assert json.loads(out)["doubled"] == 2
        out = await at.run("function", "alias", "double", "live", "1", "--weight", "2=0.25")
        assert out == "double:live leads to version 1, 25 % to version 2\n"
        assert (await at.run("function", "alias", "double", "live", "1")) == "double:live leads to version 1\n"
        out = await at.run("function", "canary", "double", "live", "2", "--weight", "0.5", "--for", "1h")
        assert out.startswith("double:live: running; version 2 with 50 %, beside version 1")
        assert (await at.read("function", "alias", "double"))[0]["canary"]["state"] == "running"
        assert "cancelled" in await at.run("function", "canary", "double", "live", "--cancel")
        assert (await at.run("function", "alias", "double", "other", "2")) == "double:other leads to version 2\n"
        assert (await at.run("function", "alias", "double", "other", "--delete")) == "double:other: gone\n"
        (tmp_path / "double" / "model.bin").write_bytes(os.urandom(12 * 1024 * 1024))  # too much for a JSON request
        assert await at.run("function", "deploy", "double", "--publish") == "✓ double: changed, version 3\n"
        shown = await at.read("function", "show", "double")
        assert shown["code_bytes"] > 12 * 1024 * 1024
        assert shown["concurrency"]["reserved"] == 3
        assert shown["event_invoke"]["on_success"].endswith("event-bus/default")


@pytest.mark.integration
async def test_a_rule_calls_a_function_and_what_it_cannot_take_is_dead(tmp_path: Path) -> None:
    (tmp_path / "rules.yaml").write_text(
        "name: orders\npattern: {detail-type: [order.ready]}\ntargets: [{id: go, kind: function, function: double,"
        " input_path: $.detail, policy: {attempts: 1}}]\n"
    )
    async with shell(tmp_path) as at:
        await at.run("function", "deploy", "double", "--retries", "0")
        assert await at.run("rule", "check", "rules.yaml") == "✓ orders: good\n"
        assert (await at.run("rule", "put", "rules.yaml")).startswith("✓ orders: added, revision ")
        assert (await at.run("rule", "put", "rules.yaml")).startswith("✓ orders: changed, revision ")
        ident = (await at.run("rule", "put-event", "order.ready", "--detail", '{"n": 5}', "--id", "o-5")).strip()
        assert ident == "o-5"
        code, out, err = await at.ask("rule", "put-event", "order.ready", "--detail", '{"n": 5}', "--id", "o-5")
        assert (code, out) == (0, "o-5\n")
        assert "known already" in err
        calls = await until(at, "function", "invocations", "double", good=lambda found: len(found) == 1)
        assert (calls[0]["status"], calls[0]["kind"]) == ("ok", "event")
        assert [one["id"] for one in await at.read("rule", "events", "--type", "order.ready")] == ["o-5"]
        found = await at.read("rule", "dry-run", "orders", "--from", "-10m")
        assert (found["matched"], found["fired"]) == (1, 1)
        assert found["firings"][0]["targets"] == [{"id": "go", "kind": "function", "payload": {"n": 5}}]
        _, out, err = await at.ask("rule", "dry-run", "rules.yaml", "--payload")
        assert "order.ready" in out
        assert '"n": 5' in out
        assert "1 would have fired" in err
        await at.run("rule", "put-event", "order.ready", "--detail", '{"n": 13}')
        (dead,) = await until(at, "function", "dead", "list", good=lambda found: found)
        assert dead["target"] == "double"
        assert '{"n":13}' in (await at.run("function", "dead", "show", dead["id"])).replace(" ", "")
        assert await at.run("function", "dead", "redrive", dead["id"]) == "1 dead letter on the way again\n"
        await until(at, "function", "invocations", "double", good=lambda found: len(found) == 3)
        (dead,) = await until(at, "function", "dead", "list", good=lambda found: found)
        assert await at.run("function", "dead", "drop", "--target", "double") == "1 dead letter dropped\n"
        done = await at.read("function", "replay", "double", "--from", "-10m", "--type", "order.ready", "--wait")
        assert (done["state"], done["put"]) == ("done", 2)
        assert [one["id"] for one in await at.read("function", "replays")] == [done["id"]]
        assert "function double" in await at.run("rule", "show", "orders")
        assert "order.ready" in await at.run("rule", "show", "orders", "--document")
        assert await at.run("rule", "disable", "orders") == "orders: off\n"
        assert (await at.run("rule", "list")).split()[:2] == ["orders", "off"]
        assert await at.run("rule", "enable", "orders") == "orders: on\n"
        assert {one["what"] for one in await at.read("rule", "history", "orders")} >= {"created", "disabled", "enabled"}
        assert await at.run("rule", "delete", "orders") == "orders: deleted\n"
        at.key = GUEST
        code, _, err = await at.ask("rule", "put", "rules.yaml")
        assert code == 1
        assert "error: " in err


@pytest.mark.integration
async def test_hooks_schedules_and_secrets(tmp_path: Path) -> None:
    (tmp_path / "rules.json").write_text(
        json.dumps(
            [
                {"name": "nightly", "schedule": {"expression": "cron(0 2 * * ? *)"}, "targets": []},
                {
                    "name": "tell",
                    "pattern": {"source": ["metaros.webhook/shop"]},
                    "targets": [{"id": "w", "kind": "webhook", "url": "https://example.org/"}],
                },
            ]
        )
    )
    async with shell(tmp_path) as at:
        assert len((await at.run("rule", "put", "rules.json")).splitlines()) == 2
        (row,) = await at.read("rule", "schedules")
        assert (row["rule"], row["expression"]) == ("nightly", "cron(0 2 * * ? *)")
        times = (
            await at.run("rule", "preview", "cron(0 2 * * ? *)", "--timezone", "Europe/Paris", "--count", "2")
        ).split()
        assert len(times) == 2
        assert (await at.run("rule", "secret", "tell", "w")).startswith("whsec_")
        made = await at.run("rule", "hook", "create", "shop", "--auth", "bearer")
        assert made.startswith(f"POST {at.url}/api/v1/hooks/shop\n")
        first = made.split()[-1]
        second = (await at.run("rule", "hook", "rotate", "shop")).strip()
        assert second not in ("", first)
        assert [one["name"] for one in await at.read("rule", "hook", "list")] == ["shop"]
        assert (await at.run("rule", "hook", "list")).split()[:3] == ["shop", "/api/v1/hooks/shop", "bearer"]
        assert await at.run("rule", "hook", "delete", "shop") == "shop: gone\n"


@pytest.mark.integration
async def test_the_log_is_followed(tmp_path: Path) -> None:
    async with shell(tmp_path) as at:
        await at.run("function", "deploy", "double")
        await at.run("function", "invoke", "double", "-d", '{"n": 1}')
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "metaros", "function", "logs", "double", "--follow"),
            env={**os.environ, **at.environ},
            stdout=asyncio.subprocess.PIPE,
        )
        assert process.stdout is not None
        try:
            async with asyncio.timeout(60):
                while b"asked for 1\n" not in (await process.stdout.readline()):
                    pass
                await at.run("function", "invoke", "double", "-d", '{"n": 2}')
                while b"asked for 2\n" not in (await process.stdout.readline()):
                    pass
                process.send_signal(signal.SIGINT)
                await process.communicate()
            assert process.returncode == 0
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()


@pytest.mark.integration
async def test_what_is_wrong_is_said(tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text("name: bad\npattern: {detail-type: [{numeric: ['<', 'x']}]}\ntargets: []\n")
    (tmp_path / "none.yaml").write_text("- description: no name\n")
    (tmp_path / "two").mkdir()
    (tmp_path / "two" / "a.py").write_text("")
    (tmp_path / "two" / "b.py").write_text("")
    async with shell(tmp_path) as at:
        for words, said in (
            (("function", "deploy", "nowhere"), "there is no nowhere"),
            (("function", "deploy", "two"), "which function handles events?"),
            (("function", "deploy", "double", "--name", "a b"), "1 to 64 of letters"),
            (("function", "deploy", "double", "--warm", "1"), "--alias live"),
            (("function", "deploy", "double", "--env", "x"), "not NAME=VALUE"),
            (("function", "invoke", "none", "-d", "{"), "--data: no JSON"),
            (("function", "invoke", "none", "--event", "sneeze"), "there is no event sneeze"),
            (("function", "alias", "none", "a", "1", "--weight", "2"), "not a version and its share"),
            (("function", "dead", "drop"), "say which"),
            (("rule", "put", "none.yaml"), "rule 1 of 1 has no name"),
            (("rule", "put", "missing.yaml"), "No such file"),
        ):
            code, _, err = await at.ask(*words)
            assert (code, said in err) == (2, True), (words, err)
        for words, said in (  # the gateway says so
            (("function", "invoke", "none"), "none"),
            (("rule", "put", "bad.yaml"), "pattern"),
            (("rule", "show", "missing"), "missing"),
        ):
            code, _, err = await at.ask(*words)
            assert (code, said in err) == (1, True), (words, err)
        code, out, _ = await at.ask("rule", "check", "bad.yaml")
        assert code == 1
        assert out.startswith("✗ bad: pattern.detail-type[0].numeric")
