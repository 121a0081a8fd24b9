"""The Alerts page over a real gateway: a robot that goes away is an alert, which somebody sees to and silences."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AsyncExitStack
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from gateway.main import Ready
from tests.e2e.real.gateway import real_gateway
from tests.gateway.harness import ScriptedAgent

pytestmark = [
    pytest.mark.browser,
    pytest.mark.integration,
    pytest.mark.xdist_group("browser"),
    pytest.mark.timeout(300),
]

FOUND_MS = 120_000


async def silent(ready: Ready, stack: AsyncExitStack) -> None:
    """A robot that says hello and then nothing: after three heartbeats its link counts as dead."""
    await stack.enter_async_context(ScriptedAgent(ready, "sim_2"))


def test_a_robot_that_goes_away_is_an_alert(tmp_path: Path, open_page: Callable[..., Page]) -> None:
    with real_gateway(tmp_path, robot=False, more_robots=silent, heartbeat_s=0.5) as gateway:
        gateway.ask("PUT", "/alert-checks/offline", {"for_s": 1.0, "clear_s": 1.0})
        page = open_page(f"{gateway.url}/alerts", link=gateway.link())
        row = page.locator("[data-alert-row]")
        expect(row).to_contain_text("Robot is offline", timeout=FOUND_MS)
        row.get_by_role("button", name="Acknowledge").click()
        expect(row.locator("[data-alert-state=acknowledged]")).to_be_visible()
        row.locator(".alert-link").click()
        page.get_by_label("Comment").fill("its battery is out")
        page.get_by_role("button", name="Comment").click()
        expect(page.locator("[data-remark=comment]")).to_contain_text("its battery is out")
        page.get_by_role("button", name="Silence for 1 h").click()
        expect(page.locator(".alert-note")).to_contain_text("Nobody is notified of it")
        page.goto(f"{gateway.url}/alerts/silences")
        expect(page.locator("[data-silence]")).to_contain_text("sim_2 · offline")
