"""Rules over HTTP: how they change, who sees them, what they do, and what they would have done."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import httpx

from gateway.api.models import rules as models
from gateway.domain.principal import Role
from tests.gateway.harness import RING, client, running_gateway

RULES = "/api/v1/rules"
ADMIN = RING.add(role=Role.ADMIN, name="chief")
NARROW = RING.add(role=Role.ADMIN, robots=("lab_*",), name="lab chief")
VIEWER = RING.add(role=Role.VIEWER, name="guest")
HOOK = {"id": "post", "kind": "webhook", "url": "https://hooks.example.org/T0/secret"}
OFFLINE = {"detail-type": ["metaros.robot.offline"]}


def refusal(answer: httpx.Response) -> tuple[int, str]:
    """The status and the code of a problem."""
    return answer.status_code, answer.json()["code"]


def document(name: str = "night", **more: Any) -> dict[str, Any]:
    """A rule's."""
    return {"name": name, "pattern": OFFLINE, "targets": [HOOK], **more}


async def test_a_rule_is_made_changed_and_taken_away(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN) as http:
        made = await http.put(f"{RULES}/night", json=document())
        assert made.status_code == 201, made.text
        rule = models.Rule.model_validate_json(made.content)
        assert (rule.name, rule.enabled, rule.maker.name, rule.stats.fired) == ("night", True, "chief", 0)
        tag = made.headers["etag"]
        assert refusal(await http.put(f"{RULES}/night", json=document(), headers={"If-Match": '"0"'})) == (
            412,
            "changed",
        )
        changed = await http.patch(f"{RULES}/night", json={"description": "at night"}, headers={"If-Match": tag})
        assert changed.json()["description"] == "at night"
        assert refusal(await http.patch(f"{RULES}/night", json={}, headers={"If-Match": tag})) == (412, "changed")
        assert (await http.post(f"{RULES}/night/disable", json={})).json()["enabled"] is False
        assert (await http.post(f"{RULES}/night/enable", json={})).json()["enabled"] is True
        listed = models.RuleList.model_validate_json((await http.get(RULES)).content)
        assert [one.name for one in listed.rules] == ["night"]
        reported = models.RuleHistory.model_validate_json((await http.get(f"{RULES}/night/history")).content)
        assert [one.what for one in reported.entries] == ["enabled", "disabled", "changed", "created"]
        assert (await http.delete(f"{RULES}/night")).status_code == 204
        assert refusal(await http.get(f"{RULES}/night")) == (404, "unknown_rule")


FAULTS: tuple[tuple[dict[str, Any], str], ...] = (  # what is wrong with a rule, and the path that is named
    ({"name": "day"}, "name"),  # put as night
    ({"pattern": {"detail-type": "x"}}, "pattern"),
    ({"pattern": None}, "pattern"),
    ({"schedule": {"expression": "cron(x)"}, "pattern": None}, "schedule"),
    ({"metric": {"series": "a.b"}, "pattern": None}, "metric"),
    ({"when": {"for": "soon"}}, "when"),
    ({"event_format": "xml"}, "event_format"),
    ({"targets": [{"id": "a", "kind": "pager"}]}, "targets[0].kind"),
    ({"targets": [HOOK, HOOK]}, "targets[1].id"),
    ({"targets": [{**HOOK, "url": "ftp://x"}]}, "targets[0].url"),
    ({"targets": [{**HOOK, "colour": "red"}]}, "targets[0].colour"),
    ({"targets": [{"id": "a", "kind": "command", "command": "fly"}]}, "targets[0].command"),
    ({"targets": [{**HOOK, "transformer": {"template": "<who>"}}]}, "targets[0].transformer.template"),
    ({"targets": [{**HOOK, "policy": {"attempts": 0}}]}, "targets[0].policy.attempts"),
)


async def test_what_cannot_be_is_named(tmp_path: Path) -> None:
    wrong = []
    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN) as http:
        for change, path in FAULTS:
            refused = await http.put(f"{RULES}/night", json=document(**change))
            if refusal(refused) != (400, "rule_invalid") or not refused.json()["path"].startswith(path):
                wrong.append((change, path, refused.text))
        assert wrong == []
        assert (await http.get(RULES)).json()["rules"] == []


async def test_who_may_not_change_rules_sees_no_secrets_and_a_scope_is_kept(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, AsyncExitStack() as stack:
        chief, narrow, guest = [
            await stack.enter_async_context(client(ready, key=key)) for key in (ADMIN, NARROW, VIEWER)
        ]
        assert (await chief.put(f"{RULES}/all", json=document("all"))).status_code == 201
        assert (await narrow.put(f"{RULES}/lab", json=document("lab"))).status_code == 201
        assert [one["name"] for one in (await narrow.get(RULES)).json()["rules"]] == ["lab"]
        for method in ("get", "delete"):
            assert refusal(await getattr(narrow, method)(f"{RULES}/all")) == (404, "unknown_rule")
        assert refusal(await narrow.put(f"{RULES}/all", json=document("all"))) == (404, "unknown_rule")
        assert refusal(await guest.put(f"{RULES}/mine", json=document("mine"))) == (403, "forbidden")
        shown = (await guest.get(f"{RULES}/all")).json()
        assert shown["targets"][0]["url"] == "https://hooks.example.org/…"
        robot = {"id": "c", "kind": "capture", "last_s": 5, "robot": "hall_1"}
        assert refusal(await narrow.put(f"{RULES}/far", json=document("far", targets=[robot]))) == (400, "rule_invalid")


async def test_what_users_put_is_judged_stored_and_reported(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN) as http:
        function = {"id": "call", "kind": "function", "function": "react"}
        pattern = {"source": ["shop"], "detail": {"state": [{"prefix": "late"}]}}
        await http.put(f"{RULES}/orders", json=document("orders", pattern=pattern, targets=[function]))
        entries = [
            {"id": "o-1", "type": "order", "source": "shop", "detail": {"state": "late again"}},
            {"id": "o-2", "type": "order", "source": "shop", "detail": {"state": "fine"}},
        ]
        put = await http.post("/api/v1/happenings", json={"entries": entries})
        assert (put.status_code, put.json()) == (202, {"ids": ["o-1", "o-2"], "duplicates": 0})
        again = await http.post("/api/v1/happenings", json={"entries": entries[:1]})
        assert again.json() == {"ids": ["o-1"], "duplicates": 1}
        found = models.HappeningList.model_validate_json(
            (await http.get("/api/v1/happenings", params={"source": "shop"})).content
        )
        assert [(one.id, one.type) for one in found.happenings] == [("o-1", "order"), ("o-2", "order")]
        stats = (await http.get(f"{RULES}/orders")).json()["stats"]
        assert (stats["matched"], stats["fired"]) == (1, 1)
        for kind, source in (
            ("metaros.robot.offline", "me"),
            ("Metaros.robot.offline", "me"),
            (" metaros", "me"),
            ("order", "metaros"),
            ("order", "metaros/webhook"),  # a rule may have {"prefix": "metaros"}
        ):
            own = {"entries": [{"type": kind, "source": source}]}
            assert refusal(await http.post("/api/v1/happenings", json=own)) == (400, "invalid_request")
        for name in ("id", "type", "source", "robot"):
            odd = {"entries": [entries[0], {"type": "order", "source": "shop", name: "a\nb"}]}
            answer = await http.post("/api/v1/happenings", json=odd)
            assert (*refusal(answer), answer.json()["detail"]) == (
                400,
                "invalid_request",
                f"entries[1].{name}: printable characters",
            )
        far = {"entries": [{"type": "order", "source": "shop", "robot": "hall_1"}]}
        async with client(ready, key=NARROW) as narrow:
            assert refusal(await narrow.post("/api/v1/happenings", json=far)) == (404, "unknown_robot")


async def test_a_dry_run_says_what_a_rule_would_have_done(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN) as http:
        entries = [{"id": f"o-{n}", "type": "order", "source": "shop", "detail": {"n": n}} for n in range(4)]
        await http.post("/api/v1/happenings", json={"entries": entries})
        target = {**HOOK, "transformer": {"paths": {"n": "$.detail.n"}, "template": {"text": "order <n>", "n": "<n>"}}}
        pattern = {"source": ["shop"], "detail": {"n": [{"numeric": [">", 1]}]}}
        body = {"rule": document(pattern=pattern, targets=[target]), "from": "-1h", "until": "now"}
        answer = await http.post(f"{RULES}/dry-run", json=body)
        done = models.DryRunResult.model_validate_json(answer.content)
        assert (done.matched, done.fired, done.truncated) == (2, 2, False)
        assert [one.targets[0].payload for one in done.firings] == [
            {"text": "order 2", "n": 2},
            {"text": "order 3", "n": 3},
        ]
        assert (await http.get(RULES)).json()["rules"] == []


async def test_schedules_are_listed_and_previewed(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN) as http:
        schedule = {"expression": "rate(5 minutes)"}
        await http.put(f"{RULES}/tick", json={"name": "tick", "schedule": schedule, "targets": [HOOK]})
        async with asyncio.timeout(60):
            while True:
                listed = (await http.get("/api/v1/schedules")).json()["schedules"]
                if listed[0]["next"] is not None:
                    break
                await asyncio.sleep(0.02)
        assert (listed[0]["rule"], listed[0]["misfire"]) == ("tick", "skip")
        asked = {"expression": "cron(0 10 * * ? *)", "timezone": "Europe/Paris", "count": 3}
        times = (await http.post("/api/v1/schedules/preview", json=asked)).json()["times"]
        assert len(times) == 3
        bad = await http.post("/api/v1/schedules/preview", json={"expression": "cron(0 25 * * ? *)"})
        assert refusal(bad) == (400, "schedule_invalid")


async def test_a_check_names_the_fault(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=VIEWER) as http:
        assert (await http.post(f"{RULES}/check", json=document())).json() == {"ok": True, "faults": []}
        (fault,) = (await http.post(f"{RULES}/check", json=document(when={"for": "x"}))).json()["faults"]
        assert fault["path"].startswith("when")
