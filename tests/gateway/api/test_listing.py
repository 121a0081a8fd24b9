"""Lists over HTTP: pages, filters, fields and ETags, and rows that are rendered once but never show what is over."""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import httpx
import pytest
import pytest_asyncio
from pydantic import BaseModel

from gateway.api import robot_rows as module
from gateway.api.listing import page_of, read_fields
from gateway.api.middleware.conditional import entity_tag, matches
from gateway.api.models.common import Robot as RobotDocument
from gateway.api.robot_pages import Page, RobotPages
from gateway.api.robot_rows import RobotRows
from gateway.api.robot_search import RobotQuery, RobotSearch
from gateway.domain.fleet.lease import Lease
from gateway.domain.principal import Role
from gateway.domain.robot import Robot
from gateway.errors import InvalidRequestError
from gateway.ingest.registry import Registry, RobotRecord
from metaros.clock import ManualClock
from tests.gateway.harness import RING, ScriptedAgent, channel, client, running_gateway

ROBOTS = "/api/v1/robots"


shared = pytest.mark.asyncio(loop_scope="module")


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def http(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[httpx.AsyncClient]:
    """An admin's client of a gateway with robots r0 to r4, whose links live."""
    key = RING.add(role=Role.ADMIN, name="lists")
    async with AsyncExitStack() as stack:
        ready = await stack.enter_async_context(running_gateway(tmp_path_factory.mktemp("gateway")))
        found = await stack.enter_async_context(client(ready, key=key))
        for number in range(5):
            agent = await stack.enter_async_context(ScriptedAgent(ready, f"r{number}"))
            await stack.enter_async_context(agent.beating())
        async with asyncio.timeout(60):
            while True:
                if len(await ids(found, online="true")) == 5:
                    break
                await asyncio.sleep(0.02)
        yield found


async def ids(http: httpx.AsyncClient, **query: str) -> list[str]:
    """Of the robots in a list."""
    answer = await http.get(ROBOTS, params=query)
    assert answer.status_code == 200, answer.text
    return [robot["id"] for robot in answer.json()["robots"]]


@shared
async def test_pages_lead_through_the_whole_list(http: httpx.AsyncClient) -> None:
    seen: list[list[str]] = []
    after: str | None = ""
    for _ in range(3):
        page = (await http.get(ROBOTS, params={"limit": 2, "after": after})).json()
        seen.append([robot["id"] for robot in page["robots"]])
        after = page["next"]
    assert (seen, after) == ([["r0", "r1"], ["r2", "r3"], ["r4"]], None)
    assert await ids(http, after="r2zzz") == ["r3", "r4"]  # also behind a robot that is gone


@shared
async def test_a_list_is_filtered_by_labels_link_and_text(http: httpx.AsyncClient) -> None:
    for robot, site in (("r1", "Berlin"), ("r3", "Paris")):
        answer = await http.patch(f"{ROBOTS}/{robot}/labels", json={"labels": {"site": site}})
        assert answer.status_code == 200, answer.text
    assert await ids(http, selector="site") == ["r1", "r3"]
    assert await ids(http, selector="site=Paris") == ["r3"]
    assert await ids(http, q="BERL") == ["r1"]
    assert await ids(http, q="r2") == ["r2"]
    assert await ids(http, online="true") == ["r0", "r1", "r2", "r3", "r4"]
    assert await ids(http, online="false") == []
    assert await ids(http, selector="site", limit="1") == ["r1"]
    refused = await http.get(ROBOTS, params={"selector": "site=("})
    assert (refused.status_code, refused.json()["code"]) == (400, "selector_invalid")


@shared
async def test_fields_and_what_was_not_changed(http: httpx.AsyncClient) -> None:
    asked = {"fields": "id,link.transport,counts.samples,counts.lost"}
    answer = await http.get(ROBOTS, params=asked)
    row = answer.json()["robots"][0]
    assert row == {"id": "r0", "link": {"transport": ""}, "counts": {"samples": 0, "lost": 0}}
    tag = answer.headers["etag"]
    again = await http.get(ROBOTS, params=asked, headers={"If-None-Match": f'"other", {tag}'})
    assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", tag)
    await http.patch(f"{ROBOTS}/r0/labels", json={"labels": {"a": "b"}})
    labels = {"fields": "id,labels"}
    before = await http.get(ROBOTS, params=labels)
    await http.patch(f"{ROBOTS}/r4/labels", json={"labels": {"a": "c"}})
    after = await http.get(ROBOTS, params=labels, headers={"If-None-Match": before.headers["etag"]})
    assert (after.status_code, after.json()["robots"][4]["labels"]) == (200, {"a": "c"})
    refused = await http.get(ROBOTS, params={"fields": "id,colour"})
    assert (refused.status_code, refused.json()["code"]) == (400, "invalid_request")
    assert "colour" in refused.json()["detail"]
    assert "last_seen" in refused.json()["detail"]


LISTS = (  # path, what holds the rows, fields to choose
    ("/api/v1/robots/r0/topics", "topics", "topic,type"),
    ("/api/v1/robots/r0/metrics", "series", "name"),
    ("/api/v1/robots/r0/gaps", "gaps", "count"),
    ("/api/v1/twins", "twins", "robot"),
    ("/api/v1/templates", "templates", "name"),
    ("/api/v1/rollouts", "rollouts", "id,state"),
    ("/api/v1/recordings", "recordings", "id"),
    ("/api/v1/commands", "commands", "id,state"),
    ("/api/v1/alerts", "alerts", "id,state"),
    ("/api/v1/silences", "silences", "id"),
    ("/api/v1/alert-checks", "checks", "id,high"),
    ("/api/v1/alert-routes", "routes", "name"),
    ("/api/v1/robots/r0/watch", "series", "series,seen"),
    ("/api/v1/users", "users", "name"),
    ("/api/v1/keys", "keys", "id"),
    ("/api/v1/enrolment-tokens", "tokens", "id"),
    ("/api/v1/identities", "identities", "robot"),
    ("/api/v1/audit", "rows", "action"),
    ("/api/v1/events", "events", "id,type"),
)


@shared
async def test_every_list_has_pages_fields_and_a_tag(http: httpx.AsyncClient) -> None:
    wrong = []
    for path, name, fields in LISTS:
        answer = await http.get(path, params={"limit": 1, "fields": fields})
        shown = answer.json()
        right = answer.status_code == 200 and all(set(row) <= set(fields.split(",")) for row in shown[name])
        right = right and ("next" in shown or name == "gaps") and answer.headers["etag"] == entity_tag(answer.content)
        refused = await http.get(path, params={"fields": "no_such_field"})
        if not right or (refused.status_code, refused.json()["code"]) != (400, "invalid_request"):
            wrong.append((path, answer.status_code, answer.text, refused.status_code))
    assert wrong == []


async def test_topics_come_in_pages(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http, ScriptedAgent(ready, "r0") as agent:
        await agent.announce(*(channel(n, f"/r0/t{n}", "std_msgs/msg/String") for n in (1, 2, 3)))
        path = f"{ROBOTS}/r0/topics"
        async with asyncio.timeout(60):
            while True:
                if len((await http.get(path)).json()["topics"]) == 3:
                    break
                await asyncio.sleep(0.02)
        first = (await http.get(path, params={"limit": 2})).json()
        rest = (await http.get(path, params={"limit": 2, "after": first["next"]})).json()
        assert [topic["topic"] for topic in (*first["topics"], *rest["topics"])] == ["/r0/t1", "/r0/t2", "/r0/t3"]
        assert rest["next"] is None


# -- the parts -------------------------------------------------------------------------------------------------------


def test_a_page_begins_behind_its_cursor() -> None:
    items = ["a", "b", "c"]
    assert page_of(items, limit=2, key=str) == (["a", "b"], "b")
    assert page_of(items, limit=2, after="b", key=str) == (["c"], None)
    assert page_of(items, limit=3, key=str) == (items, None)
    with pytest.raises(InvalidRequestError, match="after"):
        page_of(items, limit=2, after="x", key=str)


def test_fields_of_fields() -> None:
    class Document(BaseModel):
        a: dict[str, Any]
        b: int

    row = {"a": {"x": 1, "y": {"z": 2}}, "b": 3}
    for text, wanted in [
        ("", row),
        ("b", {"b": 3}),
        ("a.x, b", {"a": {"x": 1}, "b": 3}),
        ("a.y.z,a.x", {"a": {"y": {"z": 2}, "x": 1}}),
        ("a.none,b.x", {"a": {}}),
        ("a.x,a", {"a": row["a"]}),
        ("a,a.x", {"a": row["a"]}),
    ]:
        assert read_fields(text, Document).of(row) == wanted, text
    assert row == {"a": {"x": 1, "y": {"z": 2}}, "b": 3}
    for bad in ("c", ".a", ",".join(["a"] * 65)):
        with pytest.raises(InvalidRequestError, match="fields"):
            read_fields(bad, Document)


def test_a_condition_names_tags() -> None:
    assert matches('"a"', '"a"')
    assert matches('W/"a"', '"a"')
    assert matches('"b", "a"', 'W/"a"')
    assert matches("*", '"a"')
    assert not matches('"b"', '"a"')


class Rows:
    """Rows of three robots, and how often one was rendered."""

    def __init__(self, *, pages: bool = True) -> None:
        self.clock = ManualClock()
        self.registry = Registry()
        for name in ("a", "b", "c"):
            self.registry.add(RobotRecord(Robot(name), seen_ns=1))
        self.rendered = 0
        self.desired: dict[str, object] = {}
        self.leases: dict[str, Lease] = {}
        search = RobotSearch(self.registry, lambda _robot: {}, lambda: 0)
        self.rows = RobotRows(
            search, self._describe, self.desired.get, self.leases.get, given=self._given, clock=self.clock
        )
        if not pages:
            self.rows._pages = RobotPages(0)

    def _given(self) -> object:
        return dict(self.desired), {robot: lease.lease_id for robot, lease in self.leases.items()}

    def _describe(self, robot: str) -> dict[str, Any]:
        self.rendered += 1
        record = self.registry.get(robot)
        return {"id": robot, "state": record.online, "counts": record.counts.samples}

    async def tag(self, text: str = "", **query: Any) -> str:
        """Of the whole list."""
        fields = read_fields(text, RobotDocument)
        return (await self.rows.page(RobotQuery(**query), after="", limit=9, fields=fields, text=text))[1]


async def test_a_robot_is_rendered_once_until_it_changes() -> None:
    some = Rows()
    first = await some.tag()
    assert await some.tag() == first
    assert some.rendered == 3
    some.registry.get("b").over_quota(1, put_off=False)
    await some.tag()
    assert some.rendered == 4
    some.desired["a"] = object()
    some.leases["c"] = Lease("1", "c", "me", 5.0)
    await some.tag()
    assert some.rendered == 6
    some.leases["c"] = Lease("1", "c", "me", 8.0)  # renewed
    await some.tag()
    assert some.rendered == 6
    del some.leases["c"]
    await some.tag()
    assert some.rendered == 7


async def test_a_living_robot_is_shown_a_second_old_but_never_as_what_it_is_not() -> None:
    some = Rows()
    record = some.registry.get("a")
    before = await some.tag()
    record.set_online(True, wall_ns=2)
    online = await some.tag()
    assert online != before
    record.counts.samples, record.revision = 5, record.revision + 1
    assert await some.tag() == online
    some.clock.advance(module.ROW_S)
    assert await some.tag() != online
    rendered = some.rendered
    record.set_online(False, wall_ns=3)
    await some.tag()
    assert some.rendered == rendered + 1


async def test_rows_that_nobody_asks_for_go_first(monkeypatch: pytest.MonkeyPatch) -> None:
    some = Rows(pages=False)
    monkeypatch.setattr(module, "SELECTIONS", 2)
    for text in ("", "id", "state", "state", "id"):
        await some.tag(text)
    assert some.rendered == 9
    await some.tag("")
    assert some.rendered == 12
    monkeypatch.setattr(module, "OVERHEAD_BYTES", 1 << 25)  # one row is half of what may be kept
    some = Rows(pages=False)
    await some.tag()
    await some.tag()
    assert some.rendered >= 5


async def test_a_page_is_made_once_until_something_in_it_changes() -> None:
    some, fields = Rows(), read_fields("", RobotDocument)

    async def body(limit: int = 2) -> bytes:
        return (await some.rows.page(RobotQuery(), after="", limit=limit, fields=fields, text=""))[0]

    first = await body()
    assert await body() is first
    assert b'"next":"b"' in first
    assert b'"next":null' in await body(3)
    some.registry.get("c").over_quota(1, put_off=False)  # on the next page
    assert await body() is first
    some.registry.add(RobotRecord(Robot("aa"), seen_ns=1))
    assert b'"next":"aa"' in await body()


def test_pages_are_bounded_in_bytes() -> None:
    pages = RobotPages(100)

    def asked(number: int) -> tuple[RobotQuery, str, int, str]:
        return RobotQuery(), str(number), 1, ""

    def page(size: int, until_s: float = math.inf) -> Page:
        return Page(body=bytes(size), tag="", records=[], revisions=[], marks=[], given=None, until_s=until_s)

    for number, size in enumerate((25, 25, 25, 26, 25, 25)):
        pages.keep(asked(number), page(size))
    assert [pages.find(asked(number), [], None, 0.0) is not None for number in range(6)] == [0, 1, 1, 0, 1, 1]
    pages.keep(asked(1), page(20, 5.0))
    assert pages.find(asked(1), [], None, 4.9) is not None
    assert pages.find(asked(1), [], None, 5.0) is None


async def test_a_selection_that_is_forgotten_while_it_is_rendered_is_not_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "SELECTIONS", 1)
    monkeypatch.setattr(module, "RENDERED_AT_ONCE", 1)
    some = Rows()
    await asyncio.gather(*(some.tag(text) for text in ("", "id", "state")))
    await some.tag("id")
    kept = [row for selection in some.rows._selections.values() for row in selection.rows.values()]
    assert some.rows._size_bytes == sum(len(row.text) + module.OVERHEAD_BYTES for row in kept)
