"""A type that only a robot's own program knows reaches a viewer of the gateway with its definition."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import pytest

from metaros.cdr import codec
from metaros.idl import Catalogue, add_schema_text, type_hash
from tests.support.gateways.viewer import open_socket, records, subscribe
from tests.support.processes.stack import Stack
from tests.support.robots.custom_types_robot import custom_types_robot
from tests.support.waiting import wait_until


@pytest.mark.integration
def test_a_viewer_decodes_a_type_that_neither_agent_nor_gateway_has_seen(shared_gateway: Stack, tmp_path: Path) -> None:
    with shared_gateway.beside(tmp_path) as stack:
        stack.router()
        stack.agent("handy")
        wait_until(lambda: "handy" in stack.online())
        with (
            open_socket(stack.url, "/api/v1/stream") as viewer,
            custom_types_robot(f"tcp/127.0.0.1:{stack.zenoh_port}", tmp_path / "hand.log", namespace="/handy"),
        ):
            subscribe(viewer, 1, "handy", "/handy/hand")
            channels: dict[int, dict[str, Any]] = {}
            payload = b""
            deadline = time.monotonic() + 60
            while not payload and time.monotonic() < deadline:
                try:
                    frame = viewer.recv(timeout=0.5)
                except TimeoutError:
                    continue
                if isinstance(frame, str):
                    reported = json.loads(frame)
                    if reported["op"] == "channel":
                        channels[reported["channel"]] = reported
                else:
                    described = [item for item in records(frame) if channels[item.channel]["schema"]]
                    payload = described[0].payload if described else b""
    assert payload, channels
    channel = next(item for item in channels.values() if item["schema"])
    catalogue = Catalogue()
    add_schema_text(channel["type"], channel["schema"], catalogue)
    assert channel["type_hash"] == type_hash("far_robot/msg/Hand", catalogue)
    assert codec("far_robot/msg/Hand", catalogue).decode(payload).grip == "soft"
