"""The link that opens Foxglove: the ports from the status file, a ticket from the gateway, the right encoding."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

from metaros.cli.up.viewer_links import foxglove_page, make_ticket, socket_url, viewer_ports
from tests.gateway.harness import running_gateway


def test_ports_are_read_from_the_status_file(tmp_path: Path) -> None:
    status = tmp_path / "gateway.json"
    assert viewer_ports(status) == (0, 0)
    for text, found in (("{", (0, 0)), ("[]", (0, 0)), ("{}", (0, 0)), ('{"foxglove_port": 8765}', (8765, 0))):
        status.write_text(text)
        assert viewer_ports(status) == found
    status.write_text(json.dumps({"foxglove_port": 1, "rosbridge_port": 2}))
    assert viewer_ports(status) == (1, 2)


def test_the_page_is_reported_the_whole_address() -> None:
    page = foxglove_page("http://127.0.0.1:8080", 8765, "mrt_a.b")
    asked = parse_qs(urlsplit(page).query)
    assert asked == {"ds": ["foxglove-websocket"], "ds.url": ["ws://127.0.0.1:8765/?token=mrt_a.b"]}
    assert socket_url("https://[::1]:8080", 8765) == "wss://[::1]:8765"
    assert parse_qs(urlsplit(foxglove_page("https://h", 1, "")).query)["ds.url"] == ["wss://h:1"]


async def test_a_ticket_is_made_by_this_machines_own_key(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready:
        key = (ready.data_dir / "local.key").read_text().strip()
        assert (await asyncio.to_thread(make_ticket, ready.url, key=key)).startswith("mrt_")
        assert await asyncio.to_thread(make_ticket, ready.url, key="mrk_wrong") == ""
    assert await asyncio.to_thread(make_ticket, ready.url, key=key) == ""
