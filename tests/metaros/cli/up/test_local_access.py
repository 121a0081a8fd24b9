"""What a gateway makes for the user of its machine: a token that signs a browser in."""

from __future__ import annotations

import asyncio
from pathlib import Path

from metaros.cli.up.local_access import make_secret
from tests.gateway.harness import client, running_gateway

LINKS = "/api/v1/auth/links"


async def test_a_link_signs_in_and_what_goes_wrong_is_no_link(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready:
        key = (ready.data_dir / "local.key").read_text().strip()

        async def make(path: str, name: str, *, key: str) -> str:
            return await asyncio.to_thread(make_secret, ready.url, path, name, key=key)

        token = await make(LINKS, "token", key=key)
        async with client(ready, key="") as http:
            answer = await http.post("/api/v1/auth/link", json={"token": token})
        assert (answer.status_code, answer.json()["role"]) == (200, "admin")
        assert await make(LINKS, "token", key="mrk_wrong") == ""
        assert await make(LINKS, "nothing of it", key=key) == ""
        assert await make("/api/v1/nowhere", "token", key=key) == ""
    assert await make(LINKS, "token", key=key) == ""
