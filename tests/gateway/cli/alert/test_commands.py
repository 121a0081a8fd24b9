"""`metaros alert` against a real gateway in which something is wrong."""

from __future__ import annotations

import asyncio
import json
import math
import os
import signal
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from gateway.domain.principal import Role
from gateway.main import Ready
from metaros._proto import link_pb2
from metaros.clock import SystemClock
from tests.gateway.harness import RING, ScriptedAgent, client
from tests.support.gateways.alerting_gateway import Alerting, alerting_gateway
from tests.support.processes.command_line import ask_metaros

CHIEF = RING.add(role=Role.ADMIN, name="chief")
MOTOR = link_pb2.Series(series_id=1, name="motor_left.temperature", topic="/sim_1/motor_left", field="temperature")


@dataclass
class Shell:
    """A command line beside a gateway."""

    ready: Ready
    folder: Path

    @property
    def environ(self) -> dict[str, str]:
        """Of a program that asks this gateway, as an admin."""
        here = {"METAROS_GATEWAY_URL": self.ready.url, "METAROS_KEY": CHIEF, "http_proxy": "http://127.0.0.1:9"}
        return {**here, "NO_COLOR": "1"}

    async def run(self, *arguments: str) -> str:
        """What `metaros alert …` prints; it ends well."""
        code, out, err = await ask_metaros("alert", *arguments, folder=self.folder, **self.environ)
        assert code == 0, (arguments, out, err)
        return out

    async def read(self, *arguments: str) -> Any:
        """The same as JSON."""
        return json.loads(await self.run(*arguments, "-o", "json"))

    async def refused(self, *arguments: str) -> tuple[int, str]:
        """Its exit code and what it says."""
        code, _, err = await ask_metaros("alert", *arguments, folder=self.folder, **self.environ)
        assert "Traceback" not in err
        return code, err


@asynccontextmanager
async def shell(folder: Path) -> AsyncIterator[tuple[Alerting, Shell]]:
    """A gateway that alerts, and a command line."""
    async with alerting_gateway(folder) as some:
        yield some, Shell(some.ready, folder)


@pytest.mark.integration
async def test_an_alert_from_seeing_it_to_its_end(tmp_path: Path) -> None:
    async with shell(tmp_path) as (some, at):
        assert await at.run("list") == ""
        alert = (await some.open("sim_1")).id
        slow = (await some.open("sim_2", cause="rate", severity="warning", value=math.nan, high=math.nan)).id
        rows = (await at.run("list")).splitlines()
        assert [row.split()[:4] for row in rows] == [
            [slow, "sim_2", "warning", "open"],
            [alert, "sim_1", "error", "open"],
        ]
        assert [item["id"] for item in await at.read("list", "--severity", "error")] == [alert]
        assert [item["id"] for item in await at.read("list", "-r", "sim_2", "--cause", "r*")] == [slow]
        assert await at.read("list", "--quiet") == []
        said = await at.run("show", "sim_1/heat")
        assert f"alert     {alert}" in said
        assert "97.5 °C is above 95 °C" in said
        assert (await at.run("ack", "sim_1/heat", "-t", "mine")) == f"{alert}: acknowledged by chief\n"
        assert (await at.run("assign", alert, "ada")) == f"{alert}: acknowledged by chief, assigned to ada\n"
        await at.run("comment", alert, "hot indeed")
        assert (await at.run("unack", alert)).startswith(f"{alert}: open")
        assert (await at.run("normal", "sim_2/rate")).startswith(f"{slow}: ")
        assert (await at.run("resolve", alert)).startswith(f"{alert}: resolved")
        shown = await at.read("show", alert)
        kinds = ["acknowledged", "assigned", "comment", "unacknowledged", "resolved"]
        assert [item["kind"] for item in shown["remarks"]] == kinds
        assert alert not in await at.run("list")
        assert alert in await at.run("list", "--all")
        code, said = await at.refused("ack", alert)
        assert (code, "resolved" in said) == (1, True)
        code, said = await at.refused("ack", "sim_9/heat")
        assert (code, "sim_9 has no alert of heat" in said) == (2, True)


@pytest.mark.integration
async def test_silences_and_checks(tmp_path: Path) -> None:
    async with shell(tmp_path) as (some, at):
        await some.open("sim_1")
        one = await at.read("silence", "sim_1/heat", "--for", "2h", "--reason", "known")
        assert (one["robots"], one["causes"], one["by"]) == (["sim_1"], ["heat"], "chief")
        many = (await at.run("silence", "-r", "sim_*", "--cause", "rate", "--up-to", "warning")).partition(":")[0]
        listed = await at.run("silences")
        assert [row.split()[:4] for row in listed.splitlines()] == [
            [many, "sim_*", "rate", "warning"],
            [one["id"], "sim_1", "heat", "error"],
        ]
        assert await at.run("unsilence", many) == f"{many}: over\n"
        for wrong in (["silence"], ["silence", "sim_1/heat", "--cause", "x"], ["silence", "x", "--for", "soon"]):
            assert (await at.refused(*wrong))[0] == 2, wrong

        assert await at.run("checks", "--changed") == ""
        changed = await at.run("check", "motor_hot", "--high", "70", "--for", "2s", "--severity", "error")
        assert "high      70 °C *" in changed
        assert "for       2 s *" in changed
        row = next(row for row in (await at.run("checks")).splitlines() if row.startswith("motor_hot "))
        assert "70 °C *" in row
        assert (await at.read("check", "motor_hot", "--high", "none"))["high"] is None
        assert (await at.read("check", "motor_hot", "--off"))["enabled"] is False
        assert (await at.read("check", "motor_hot", "--reset"))["changed"] == []
        for wrong in (["nothing"], ["motor_hot", "--high", "hot"], ["motor_hot", "--on", "--reset"]):
            assert (await at.refused("check", *wrong))[0] == 2, wrong
        assert (await at.run("routes")) == ""
        assert (await at.refused("test-notice", "ops"))[0] == 1


@pytest.mark.integration
async def test_learning_and_backtests(tmp_path: Path) -> None:
    async with shell(tmp_path) as (some, at), ScriptedAgent(some.ready) as agent:
        await agent.announce(series=[MOTOR])
        assert "sim_1" not in await at.run("learning", "sim_1")
        now_ns = SystemClock().wall_ns()
        rows = []
        for second in range(120):
            hot = 90.0 if 60 <= second < 100 else 40.0 + math.sin(second)
            rows.append((1, now_ns - (180 - second) * 10**9, hot))
        await agent.rows(1, rows)
        async with client(some.ready) as http, asyncio.timeout(60):
            while True:
                found = (await http.get("/api/v1/robots/sim_1/metrics")).json()["series"]
                if found and found[0]["samples"] == 120:
                    break
                await asyncio.sleep(0.05)
        asked = ("backtest", "sim_1", "--start", "-5m", "--only", "motor_hot")
        said = await at.run(*asked, "--svg", "plot.svg")
        assert "motor_left.temperature" in said
        assert [line.split()[0] for line in said.splitlines() if line][-1] == "heat"
        assert ElementTree.parse(tmp_path / "plot.svg").getroot().tag.endswith("svg")
        report = await at.read(*asked, "--check", "motor_hot:high=95")
        assert (report["samples"], report["findings"]) == (120, [])
        assert "nothing would have fired" in await at.run(*asked, "--check", "motor_hot:enabled=false")
        assert (await at.refused(*asked, "--check", "motor_hot=95"))[0] == 2
        code, said = await at.refused("backtest", "sim_1", "--only", "nothing")
        assert (code, "there is no check 'nothing'" in said) == (1, True)


@pytest.mark.integration
async def test_watching_prints_a_line_a_change(tmp_path: Path) -> None:
    async with shell(tmp_path) as (some, at):
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-u", "-m", "metaros", "alert", "watch", "--cause", "heat"),
            env={**os.environ, **at.environ},
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
        assert process.stdout is not None
        assert process.stderr is not None
        async with asyncio.timeout(60):
            assert (await process.stderr.readline()).startswith(b"waiting for alerts")
            await some.open("sim_2", cause="rate")
            alert = (await some.open("sim_1")).id
            line = (await process.stdout.readline()).decode()
            assert line[10:].split()[:5] == [alert, "▲", "opened", "error", "sim_1"]
            await at.run("ack", alert)
            assert "acknowledged" in (await process.stdout.readline()).decode()
            process.send_signal(signal.SIGINT)
            assert await process.wait() == 0
