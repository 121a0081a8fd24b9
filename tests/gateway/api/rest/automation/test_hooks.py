"""Webhooks of others: who may send them, once, and what becomes of them."""

from __future__ import annotations

from contextlib import AsyncExitStack
from pathlib import Path

import httpx

from gateway.api.models import rules as models
from gateway.domain.principal import Role
from gateway.outbound.webhook import signature, signing_key
from metaros.clock import SystemClock
from tests.gateway.harness import RING, client, running_gateway

HOOKS = "/api/v1/hooks"
ADMIN = RING.add(role=Role.ADMIN, name="chief")
NARROW = RING.add(role=Role.ADMIN, robots=("lab_*",), name="lab chief")
BODY = b'{"action": "opened"}'


def refusal(answer: httpx.Response) -> tuple[int, str]:
    """The status and the code of a problem."""
    return answer.status_code, answer.json()["code"]


def signed(secret: str, body: bytes = BODY, *, message: str = "msg_1", late_s: int = 0) -> dict[str, str]:
    """The headers of a webhook."""
    at_s = SystemClock().wall_ns() // 10**9 - late_s
    return {
        "content-type": "application/json",
        "webhook-id": message,
        "webhook-timestamp": str(at_s),
        "webhook-signature": f"v1,bm8= {signature(signing_key(secret), body, message=message, at_s=at_s)}",
    }


async def test_a_signed_webhook_is_taken_once_and_sets_off_a_rule(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, AsyncExitStack() as stack:
        chief, nobody = [await stack.enter_async_context(client(ready, key=key)) for key in (ADMIN, "")]
        made = await chief.post(HOOKS, json={"name": "git", "robot": "lab_1"})
        hook = models.HookMade.model_validate_json(made.content)
        assert (made.status_code, hook.path, hook.source) == (201, "/api/v1/hooks/git", "metaros.webhook/git")
        target = {"id": "call", "kind": "function", "function": "react"}
        rule = {"name": "git", "pattern": {"source": ["metaros.webhook/git"]}, "targets": [target]}
        assert (await chief.put("/api/v1/rules/git", json=rule)).status_code == 201
        first = await nobody.post(hook.path, content=BODY, headers=signed(hook.secret))
        again = await nobody.post(hook.path, content=BODY, headers=signed(hook.secret))
        assert (first.status_code, first.json()) == (202, {"id": "msg_1", "duplicate": False})
        assert again.json() == {"id": "msg_1", "duplicate": True}
        assert (await chief.get("/api/v1/rules/git")).json()["stats"]["fired"] == 1
        (shown,) = (await chief.get(HOOKS)).json()["hooks"]
        assert (shown["accepted"], shown["refused"], "secret" in shown) == (1, 0, False)
        found = (await chief.get("/api/v1/happenings", params={"type": "metaros.webhook"})).json()["happenings"]
        assert [(one["subject"], one["data"]["body"]) for one in found] == [("lab_1", {"action": "opened"})]


async def test_what_does_not_prove_its_sender_is_refused(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, AsyncExitStack() as stack:
        chief, nobody = [await stack.enter_async_context(client(ready, key=key)) for key in (ADMIN, "")]
        secret = (await chief.post(HOOKS, json={"name": "git"})).json()["secret"]
        unsigned = {name: value for name, value in signed(secret).items() if name != "webhook-signature"}
        for wrong, body, headers in (
            ("body", b'{"action": "closed"}', signed(secret)),
            ("time", BODY, signed(secret, late_s=600)),
            ("secret", BODY, signed("whsec_bm8=")),
            ("unsigned", BODY, unsigned),
        ):
            refused = await nobody.post(f"{HOOKS}/git", content=body, headers=headers)
            assert refusal(refused) == (401, "hook_refused"), wrong
        assert (await chief.get("/api/v1/happenings", params={"type": "metaros.webhook"})).json()["happenings"] == []
        assert (await chief.get(HOOKS)).json()["hooks"][0]["refused"] == 4


async def test_a_bearer_hook_and_a_new_secret(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, AsyncExitStack() as stack:
        chief, nobody = [await stack.enter_async_context(client(ready, key=key)) for key in (ADMIN, "")]
        secret = (await chief.post(HOOKS, json={"name": "cam", "auth": "bearer"})).json()["secret"]

        async def send(text: str) -> httpx.Response:
            return await nobody.post(f"{HOOKS}/cam", json={"n": 1}, headers={"Authorization": f"Bearer {text}"})

        assert (await send(secret)).status_code == 202
        assert refusal(await send("mrk_no")) == (401, "hook_refused")
        fresh = (await chief.post(f"{HOOKS}/cam/rotate", json={})).json()["secret"]
        assert refusal(await send(secret)) == (401, "hook_refused")
        assert (await send(fresh)).status_code == 202
        assert (await chief.delete(f"{HOOKS}/cam")).status_code == 204
        assert refusal(await send(fresh)) == (404, "unknown_hook")


async def test_hooks_have_bounds_and_a_scope(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, AsyncExitStack() as stack:
        chief, narrow, nobody = [await stack.enter_async_context(client(ready, key=key)) for key in (ADMIN, NARROW, "")]
        await chief.post(HOOKS, json={"name": "git"})
        assert refusal(await chief.post(HOOKS, json={"name": "git"})) == (409, "hook_exists")
        for name in ("Git", "a/b", ".git"):
            unfit = await chief.post(HOOKS, json={"name": name})
            assert refusal(unfit) == (400, "invalid_request")
            assert unfit.json()["detail"].startswith("name: 1 to 63 of"), name
        assert refusal(await narrow.post(HOOKS, json={"name": "any"})) == (400, "invalid_request")
        assert (await narrow.post(HOOKS, json={"name": "mine", "robot": "lab_1"})).status_code == 201
        assert [one["name"] for one in (await narrow.get(HOOKS)).json()["hooks"]] == ["mine"]
        assert refusal(await narrow.delete(f"{HOOKS}/git")) == (404, "unknown_hook")
        large = b'{"x": "' + b"x" * (256 * 1024) + b'"}'
        headers = {"content-type": "application/json"}
        assert refusal(await nobody.post(f"{HOOKS}/git", content=large, headers=headers)) == (413, "body_too_large")
