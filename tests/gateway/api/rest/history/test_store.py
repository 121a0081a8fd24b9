"""GET /api/v1/store and the plan of the retention, of a real gateway."""

from __future__ import annotations

from pathlib import Path

import httpx
import pytest

from gateway.api.models import store
from gateway.store import storage
from tests.gateway.harness import DATA, ScriptedAgent, channel, client, running_gateway


async def read_account(http: httpx.AsyncClient) -> store.StoreAccount:
    """As a client reads it."""
    answer = await http.get("/api/v1/store")
    return store.StoreAccount.model_validate_json(answer.content)


async def test_the_account_and_the_plan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(storage, "_FRESH_S", 0.0)
    async with running_gateway(tmp_path) as ready, client(ready) as http, ScriptedAgent(ready) as agent:
        await agent.announce(channel(1, "/sim_1/scan", "std_msgs/msg/String"))
        await agent.samples(1, 1, [b"x" * 1000])
        await agent.next("ack", DATA)
        account = await read_account(http)
        assert account.total_bytes > 1000
        assert [item.robot for item in account.robots] == ["sim_1"]
        assert account.objects.where == str(tmp_path / "data" / "objects")
        assert {item.class_: item.bytes > 1000 for item in account.classes} == {
            "metric": False,
            "bulk": True,
            "event": False,
            "recording": False,
        }
        assert {item.class_: item.keep_days for item in account.classes}["event"] == 90
        answer = await http.get("/api/v1/store/retention")
        plan = store.RetentionPlan.model_validate_json(answer.content)
        assert (plan.items, plan.bytes, plan.gaps) == ([], 0, 0)
