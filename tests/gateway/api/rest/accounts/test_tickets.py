"""A ticket over HTTP: made by who signed in, good for viewers' sockets, and for nothing else."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from gateway.api.models import identity
from tests.gateway.harness import OPERATOR_KEY, client, running_gateway


async def test_a_ticket_opens_the_stream_from_any_page_and_nothing_else(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, anonymous=False) as ready:
        local = (ready.data_dir / "local.key").read_text().strip()
        async with client(ready, key=local) as http:
            answer = await http.post("/api/v1/auth/tickets", json={"robots": ["r1"], "ttl_s": 60})
            assert answer.status_code == 201
            ticket = identity.Ticket.model_validate(answer.json()).ticket
            beyond = await http.post("/api/v1/auth/tickets", json={"role": "owner"})
            assert (beyond.status_code, beyond.json()["code"]) == (400, "invalid_request")
        stream = f"ws://127.0.0.1:{ready.http_port}/api/v1/stream"
        page = {"proxy": None, "origin": "https://app.foxglove.dev"}
        async with connect(f"{stream}?token={ticket}", **page) as viewer:
            assert json.loads(await asyncio.wait_for(viewer.recv(), 60))["op"] == "welcome"
        async with client(ready, key=ticket) as http:
            for path in ("/api/v1/robots", f"/api/v1/robots?token={ticket}"):
                refused = await http.get(path)
                assert (refused.status_code, refused.json()["code"]) == (401, "bad_credentials")
        for url in (stream, f"{stream}?token=", f"{stream}?token={ticket}x", f"{stream}?token={ticket}&token={ticket}"):
            with pytest.raises(InvalidStatus) as refusal:
                await connect(url, **page)
            assert refusal.value.response.status_code in (401, 403), url
        headers = {"Authorization": f"Bearer {OPERATOR_KEY}"}
        with pytest.raises(InvalidStatus):  # a key in two places is a mistake
            await connect(f"{stream}?token={OPERATOR_KEY}", additional_headers=headers, **page)
