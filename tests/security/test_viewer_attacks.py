"""What a stranger tries at viewers' doors: foreign pages, robots that tell too much, clients that ask for too much."""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from gateway.domain.principal import Role
from tests.gateway.harness import ScriptedAgent, running_gateway
from tests.support.key_ring import KeyRing

DOORS = ("/foxglove", "/foxglove/sim_1", "/rosbridge", "/rosbridge/sim_1", "/api/v1/stream")
SPOKEN: Any = ["foxglove.sdk.v1", "metaros.v1"]


LIKE_TOKEN = ("tokens=x", "x=token", "%74oken=x", "drive=token&robot=sim_1")


async def test_a_word_like_token_opens_no_door_to_a_foreign_page(tmp_path: Path) -> None:
    """The wall lets a page of anybody in that was given a token: not one that only writes the word."""
    ring = KeyRing()
    cookie, _ = ring.sign_in(role=Role.OPERATOR, name="eve's victim")
    async with running_gateway(tmp_path, door=ring) as ready, ScriptedAgent(ready):
        for door, query, headers in product(DOORS, LIKE_TOKEN, ({}, {"Cookie": f"metaros_session={cookie}"})):
            url = f"{ready.url.replace('http', 'ws', 1)}{door}?{query}"
            origin: Any = "http://evil.example"
            with pytest.raises(InvalidStatus) as caught:
                await connect(url, origin=origin, additional_headers=headers, subprotocols=SPOKEN, proxy=None)
            assert caught.value.response.status_code == 403, (door, query, headers)
            assert json.loads(caught.value.response.body)["code"] == "origin_not_allowed"
