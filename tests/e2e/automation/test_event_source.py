"""A browser's own EventSource follows the gateway's events, and misses none over a restart of the gateway."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Page

from tests.e2e.real.gateway import RealGateway, real_gateway

pytestmark = [pytest.mark.browser, pytest.mark.xdist_group("browser")]

FOLLOW = """() => {
  window.seen = []
  const source = new EventSource('/api/v1/events?after=0')
  source.onmessage = (event) => window.seen.push({...JSON.parse(event.data), id: Number(event.lastEventId)})
}"""
ENDED = "() => window.seen.filter((event) => event.type === 'metaros.command.ended').length >= {}"


def command(gateway: RealGateway) -> None:
    """Have the robot do something: its end is an event."""
    asked = {"kind": "call_service", "request": {"service": "x", "type": "std_srvs/srv/Trigger", "request": {}}}
    gateway.ask("POST", "/robots/sim_1/commands", asked)


def test_no_event_is_missed_over_a_restart(tmp_path: Path, open_page: Callable[..., Page]) -> None:
    with real_gateway(tmp_path) as first:
        page = open_page(f"{first.url}/docs")
        page.evaluate(FOLLOW)
        command(first)
        page.wait_for_function(ENDED.format(1))
        port = urlsplit(first.url).port
    with real_gateway(tmp_path, port=port) as second:
        command(second)
        page.wait_for_function(ENDED.format(2))
        seen = page.evaluate("() => window.seen")
    ids = [event["id"] for event in seen]
    assert ids == list(range(1, len(ids) + 1))
    types = [event["type"] for event in seen]
    assert types[0] == "metaros.robot.online"
    assert "metaros.robot.offline" in types or types.count("metaros.robot.online") == 2
    assert {event["specversion"] for event in seen} == {"1.0"}
