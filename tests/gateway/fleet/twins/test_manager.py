"""Twins at one gateway, on both databases: edits, templates, selectors, going back, and what robots are sent."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import orjson
import pytest

from gateway.domain.errors import SelectorError, TwinChangedError, UnknownRevisionError
from gateway.domain.fleet.selector import MAX_LABELS, Selector
from gateway.domain.robot import Robot
from gateway.errors import ForbiddenError, UnknownRobotError
from gateway.fleet.twins.manager import Editor
from gateway.fleet.twins.plan import Edit
from gateway.store import RobotWrite
from gateway.store.fleet import templates as templates_module
from metaros._proto import link_pb2
from metaros.fleet.twin import TwinError
from metaros.limits import LIMITS
from tests.gateway.fleet.twin_rig import Rig, rig_on
from tests.support.servers.databases import on_both

OPERATOR, ADMIN = Editor(name="olga"), Editor(name="ada", code=True)
LIDAR = {"nodes": {"lidar": {"allowed": "lidar"}}}


@pytest.fixture
async def rig(store_url: str, tmp_path: Path) -> AsyncIterator[Rig]:
    async with rig_on(store_url, tmp_path) as made:
        yield made


async def patch(rig: Rig, robot: str, document: dict[str, Any], editor: Editor = ADMIN, **options: Any) -> Any:
    return await rig.twins.manager.edit(robot, Edit(patch=document), editor, dry_run=False, **options)


async def template(rig: Rig, name: str, selector: str, document: dict[str, Any], **options: Any) -> Any:
    wanted = {"priority": 0, "dry_run": False, **options}
    return await rig.twins.templates.put(name, selector=selector, document=document, editor=ADMIN, **wanted)


async def test_a_robot_gets_what_is_desired_and_confirms_it(rig: Rig) -> None:
    robot = await rig.robot("r1")
    outcome = await patch(rig, "r1", LIDAR)
    assert (outcome.after.revision, [change.path for change in outcome.changes]) == (1, ["/nodes"])
    await rig.work(lambda: robot.state == "applied" and robot.applied == 1)
    state = await rig.twins.manager.state("r1")
    assert state.in_step
    assert robot.document == state.desired.document == b'{"nodes":{"lidar":{"allowed":"lidar"}}}'
    assert state.reported is not None
    assert (state.reported.applied, rig.twins.manager.reported_of("r1")) == (1, {"documents": 1})


async def test_nothing_wrong_is_stored_and_nothing_unchanged_gets_a_revision(rig: Rig) -> None:
    await rig.robot("r1")
    await patch(rig, "r1", LIDAR)
    with pytest.raises(TwinError, match=r"nodes\.lidar\.nice: -20 to 19, not 40"):
        await patch(rig, "r1", {"nodes": {"lidar": {"nice": 40}}})
    with pytest.raises(TwinError, match="exactly one of bundle, allowed, command"):
        await patch(rig, "r1", {"nodes": {"lidar": {"allowed": None}}})
    with pytest.raises(UnknownRobotError):
        await patch(rig, "r2", {})
    assert (await patch(rig, "r1", LIDAR)).changed is False
    assert (await rig.twins.manager.state("r1")).desired.revision == 1
    tried = await rig.twins.manager.edit("r1", Edit(patch={"nodes": None}), ADMIN, dry_run=True)
    assert [change.text for change in tried.changes] == ['- /nodes: {"lidar": {"allowed": "lidar"}}']
    assert (await rig.twins.manager.state("r1")).desired.revision == 1


@on_both
async def test_who_was_slower_is_reported(rig: Rig) -> None:
    await rig.robot("r1")
    first = await patch(rig, "r1", LIDAR, expected=(0, None))
    with pytest.raises(TwinChangedError, match=r"at 1\.1 by now"):
        await patch(rig, "r1", {"budget": {"bytes_per_s": 0}}, expected=(0, None))
    await patch(rig, "r1", {"budget": {"bytes_per_s": 0}}, expected=(1, first.after.edition))
    # Of many at once with the same expectation, one is first.
    tries = [patch(rig, "r1", {"budget": {"bytes_per_s": 1000 + i}}, expected=(2, None)) for i in range(8)]
    results = await asyncio.gather(*tries, return_exceptions=True)
    assert sum(isinstance(item, TwinChangedError) for item in results) == 7


async def test_what_runs_on_a_robot_is_an_admins_to_change(rig: Rig) -> None:
    await rig.robot("r1")
    bundle = {"nodes": {"lidar": {"bundle": "lidar-node", "version": "1.0.0"}}}
    with pytest.raises(ForbiddenError, match=r"nodes\.lidar\.bundle"):
        await patch(rig, "r1", bundle, OPERATOR)
    await patch(rig, "r1", bundle)
    for change in ({"version": "1.1.0"}, {"args": ["-x"]}):
        with pytest.raises(ForbiddenError):
            await patch(rig, "r1", {"nodes": {"lidar": change}}, OPERATOR)
    await patch(rig, "r1", {"nodes": {"lidar": {"nice": 5, "run": False}}, "budget": {"bytes_per_s": 9000}}, OPERATOR)
    await patch(rig, "r1", {"nodes": {"lidar": {"version": "1.1.0"}}})
    with pytest.raises(ForbiddenError):
        await rig.twins.manager.revert("r1", 1, OPERATOR, dry_run=False)
    with pytest.raises(ForbiddenError, match=r"agent\.version"):
        await patch(rig, "r1", {"agent": {"version": "2.0.0"}}, OPERATOR)
    # A label that brings a template with code is the same change.
    await template(rig, "tools", "tools", {"nodes": {"tool": {"command": ["sh"]}}})
    labels = Edit(labels={"tools": "yes"})
    with pytest.raises(ForbiddenError):
        await rig.twins.manager.edit("r1", labels, OPERATOR, dry_run=False)
    await rig.twins.manager.edit("r1", labels, ADMIN, dry_run=False)


async def test_code_does_not_hide_behind_a_document_that_cannot_be_made(rig: Rig) -> None:
    """A robot's own words (its labels) bring two templates together that do not fit: until somebody mends it its
    document stays, and what is laid into its own part meanwhile comes into force later, by whoever mends it."""
    robot = await rig.robot("r1", a="1")
    await template(rig, "first", "a", {"nodes": {"lidar": {"bundle": "lidar-node", "version": "1.0.0"}}})
    await template(rig, "other", "b", {"nodes": {"lidar": {"allowed": "lidar"}}})
    robot.labels["b"] = "1"
    rig.store.submit(RobotWrite(Robot("r1", labels=robot.labels), 2))
    await rig.store.flush()
    rig.cut("r1")
    rig.link("r1")
    await rig.work(lambda: bool((found := rig.twins.manager.desired_of("r1")) and found.problem))

    async def many(document: dict[str, Any], editor: Editor) -> Any:
        edit = Edit(patch=document)
        return await rig.twins.manager.edit_many(
            Selector.parse("robot=r1"), edit, editor, sees=lambda _: True, dry_run=False
        )

    for evil in ({"nodes": {"x": {"bundle": "evil", "version": "1.0"}}}, {"agent": {"version": "0.1"}}):
        with pytest.raises(ForbiddenError):
            await many(evil, OPERATOR)
    assert (await many({"budget": {"bytes_per_s": 9000}}, OPERATOR))[0].changed
    mended = Edit(document={"nodes": {"lidar": {"bundle": None, "version": None}}})
    assert (await rig.twins.manager.edit("r1", mended, ADMIN, dry_run=False)).after.problem == ""


async def test_what_is_said_of_a_templates_node_does_not_hold_the_template(rig: Rig) -> None:
    """An operator of one robot stops a node there, a rollout gives it a version: the template is the admin's still."""
    robot = await rig.robot("r1", a="1")
    node = {"nodes": {"lidar": {"allowed": "lidar"}}}
    await template(rig, "first", "a", node)
    await patch(rig, "r1", {"nodes": {"lidar": {"run": False}}}, OPERATOR)
    await rig.twins.templates.remove("first", editor=ADMIN, dry_run=False)
    desired = (await rig.twins.manager.state("r1")).desired
    assert (desired.document, desired.problem) == (b"{}", "")
    await rig.work(lambda: robot.state == "applied" and robot.document == b"{}")
    with pytest.raises(TwinError, match="exactly one of"):
        await patch(rig, "r1", {"nodes": {"lidar": {"run": True}}}, OPERATOR)
    await patch(rig, "r1", {"budget": {"bytes_per_s": 9000}}, OPERATOR)
    await template(rig, "again", "a", node)
    living = orjson.loads((await rig.twins.manager.state("r1")).desired.document)["nodes"]
    assert living == {"lidar": {"allowed": "lidar", "run": False}}, "it is stopped still"


async def test_labels_are_bounded_in_sum(rig: Rig) -> None:
    await rig.robot("r1")
    for start in range(0, MAX_LABELS, 16):
        labels = Edit(labels={f"l{start + n}": "x" for n in range(16)})
        await rig.twins.manager.edit("r1", labels, OPERATOR, dry_run=False)
    with pytest.raises(SelectorError, match="64 labels"):
        await rig.twins.manager.edit("r1", Edit(labels={"more": "x"}), OPERATOR, dry_run=False)
    await rig.twins.manager.edit("r1", Edit(labels={"more": "x", "l0": None}), OPERATOR, dry_run=False)
    assert len((await rig.twins.manager.state("r1")).labels) == MAX_LABELS


@on_both
async def test_templates_reach_whom_they_name_and_the_own_document_wins(rig: Rig) -> None:
    for name, site in (("a1", "lab"), ("a2", "lab"), ("b1", "hall")):
        await rig.robot(name, site=site)
    await patch(rig, "a2", {"topics": {"camera": {"rate_hz": 1.0}}})
    await template(rig, "all", "", {"topics": {"camera": {"rate_hz": 9.0}}, "budget": {"bytes_per_s": 5000}})
    _, outcomes = await template(rig, "lab", "site=lab", {"topics": {"camera": {"rate_hz": 5.0}}}, priority=1)
    assert [item.after.robot for item in outcomes] == ["a1", "a2"]
    robots = rig.fleet.robots.values()
    await rig.work(lambda: all(r.state == "applied" and b"5000" in r.document for r in robots))
    rates = {}
    for state in await rig.twins.manager.states(Selector.parse(""), lambda robot: True):
        rates[state.desired.robot] = orjson.loads(state.desired.document)["topics"]["camera"]["rate_hz"]
    assert rates == {"a1": 5.0, "a2": 1.0, "b1": 9.0}
    seen = [s.desired.robot for s in await rig.twins.manager.states(Selector.parse("site=lab"), lambda r: r != "a1")]
    assert seen == ["a2"]
    await rig.twins.templates.remove("lab", editor=ADMIN, dry_run=False)
    assert b"9.0" in (await rig.twins.manager.state("a1")).desired.document
    with pytest.raises(SelectorError):
        await template(rig, "bad", "site==", {})


@on_both
async def test_a_template_goes_back_even_when_it_is_gone_and_the_oldest_changes_go(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(templates_module, "LIMITS", replace(LIMITS, template_history=4))
    await rig.robot("r1")
    for rate in (1000, 2000):
        await template(rig, "all", "", {"budget": {"bytes_per_s": rate}}, priority=rate // 1000)
    await rig.twins.templates.remove("all", editor=ADMIN, dry_run=False)
    entries = await rig.twins.templates.history("all", limit=10)
    assert [(item.removed, item.template.priority) for item in entries] == [(True, 2), (False, 2), (False, 1)]
    first = entries[-1].template.revision
    tried, _ = await rig.twins.templates.revert("all", first, editor=ADMIN, dry_run=True)
    assert await rig.twins.templates.all() == []
    made, outcomes = await rig.twins.templates.revert("all", first, editor=ADMIN, dry_run=False)
    assert (made.priority, made.document, made.selector) == (tried.priority, tried.document, tried.selector)
    assert [item.after.document for item in outcomes] == [b'{"budget":{"bytes_per_s":1000}}']
    await template(rig, "other", "", {})
    assert len(await rig.twins.templates.history("all", limit=10)) == 3  # the first of them made room
    with pytest.raises(UnknownRevisionError):
        await rig.twins.templates.revert("all", first, editor=ADMIN, dry_run=False)
    with pytest.raises(UnknownRevisionError):
        await rig.twins.templates.revert("other", made.revision, editor=ADMIN, dry_run=False)


async def test_a_template_that_would_break_a_robot_changes_none(rig: Rig) -> None:
    await rig.robot("a1")
    await rig.robot("a2")
    await patch(rig, "a2", {"nodes": {"lidar": {"bundle": "x", "version": "1.0"}}})
    with pytest.raises(TwinError, match=r"nodes.lidar: exactly one of .* \(robot a2\)"):
        await template(rig, "lidar", "", LIDAR)
    assert await rig.twins.templates.all() == []
    assert (await rig.twins.manager.state("a1")).desired.revision == 0


async def test_labels_of_a_hello_bring_templates(rig: Rig) -> None:
    await template(rig, "lab", "site=lab", LIDAR)
    robot = await rig.robot("r1", site="lab")
    await rig.work(lambda: robot.applied == 1 and robot.state == "applied")
    rig.cut("r1")
    robot.labels = {"site": "hall"}
    rig.store.submit(RobotWrite(Robot("r1", labels=robot.labels), 2))
    rig.link("r1")
    await rig.work(lambda: robot.applied == 2 and robot.document == b"{}")
    await rig.twins.manager.edit("r1", Edit(labels={"site": "lab"}), ADMIN, dry_run=False)
    await rig.work(lambda: robot.applied == 3 and robot.state == "applied")
    assert rig.twins.labels_of("r1") == {"site": "lab"}


async def test_a_robot_that_has_just_connected_is_known_before_the_store_has_written_it(rig: Rig) -> None:
    begun, busy = threading.Event(), threading.Event()

    def hold(engine: object) -> bool:
        begun.set()
        return busy.wait(60)

    writing = asyncio.ensure_future(rig.store.run(hold))
    assert await asyncio.to_thread(begun.wait, 60)
    rig.store.submit(RobotWrite(Robot("new", labels={"site": "lab"}), 1))
    looking = [asyncio.ensure_future(rig.twins.manager.state("new"))]
    looking.append(asyncio.ensure_future(rig.twins.manager.history("new", limit=1)))
    looking.append(asyncio.ensure_future(rig.twins.manager.edit("new", Edit(patch=LIDAR), ADMIN, dry_run=True)))
    done, _ = await asyncio.wait(looking, timeout=0.05)
    busy.set()
    await writing
    state, history, tried = await asyncio.gather(*looking)
    assert (done, state.labels, history, tried.changed) == (set(), {"site": "lab"}, [], True)
    trial = rig.twins.manager.edit("nobody", Edit(patch=LIDAR), ADMIN, dry_run=True)
    for look in (rig.twins.manager.state("nobody"), rig.twins.manager.history("nobody", limit=1), trial):
        with pytest.raises(UnknownRobotError):
            await look


async def test_a_template_names_robots_that_the_store_learns_of_later(rig: Rig) -> None:
    """A robot's first report and a template may cross: neither comes a second time."""
    rig.fleet.add("new")
    robot = rig.link("new")
    _, outcomes = await template(rig, "everyone", "", LIDAR)
    assert outcomes == []
    rig.store.submit(RobotWrite(Robot("new"), 1))
    await rig.work(lambda: robot.applied > 0)
    assert robot.document == b'{"nodes":{"lidar":{"allowed":"lidar"}}}'


@on_both
async def test_many_at_once_or_none(rig: Rig) -> None:
    for number in range(5):
        await rig.robot(f"r{number}", site="lab" if number < 3 else "hall")
    edit = Edit(patch={"budget": {"bytes_per_s": 4000}})
    every = {"sees": lambda robot: robot != "r0", "dry_run": False}
    outcomes = await rig.twins.manager.edit_many(Selector.parse("site=lab"), edit, OPERATOR, **every)
    assert [item.after.robot for item in outcomes if item.changed] == ["r1", "r2"]
    await patch(rig, "r4", {"nodes": {"x": {"allowed": "x"}}})
    partial = Edit(patch={"nodes": {"x": {"nice": 3}}})
    with pytest.raises(TwinError, match=r"\(robot r1, r2, r3\)"):
        await rig.twins.manager.edit_many(Selector.parse(""), partial, OPERATOR, **every)
    assert (await rig.twins.manager.state("r4")).desired.revision == 1


@on_both
async def test_going_back_and_the_history(rig: Rig) -> None:
    await rig.robot("r1")
    for rate in (1000, 2000, 3000):
        await patch(rig, "r1", {"budget": {"bytes_per_s": rate}}, Editor(name=f"by {rate}", reason="why not"))
    outcome = await rig.twins.manager.revert("r1", 1, OPERATOR, dry_run=False)
    assert (outcome.after.revision, outcome.after.own) == (4, b'{"budget":{"bytes_per_s":1000}}')
    entries = await rig.twins.manager.history("r1", limit=3)
    assert [(item.revision, item.author) for item in entries] == [(4, "olga"), (3, "by 3000"), (2, "by 2000")]
    with pytest.raises(UnknownRevisionError):
        await rig.twins.manager.revert("r1", 77, OPERATOR, dry_run=False)
    assert (await rig.twins.manager.revert("r1", 0, OPERATOR, dry_run=False)).after.document == b"{}"


async def test_what_a_robot_went_back_from_is_not_sent_again(rig: Rig) -> None:
    robot = await rig.robot("r1")
    await patch(rig, "r1", LIDAR)
    await rig.work(lambda: robot.applied == 1 and robot.state == "applied")
    await patch(rig, "r1", {"budget": {"bytes_per_s": 1000}})
    await rig.work(lambda: bool(robot.inbox) or robot.state == "confirming" or robot.applied == 2)
    rig.cut("r1")  # the new state has killed the link, say
    robot.state, robot.before = "confirming", (1, b'{"nodes":{"lidar":{"allowed":"lidar"}}}')
    assert robot.window_over()
    sent = len(robot.seen)
    rig.link("r1")
    state = await rig.twins.manager.state("r1")
    assert not state.in_step
    assert [change.path for change in state.behind] == ["/budget"]
    await patch(rig, "r1", {"budget": {"bytes_per_s": 2000}})
    await rig.work(lambda: robot.applied == 3 and robot.state == "applied")
    assert robot.seen[sent:] == [3]
    again = await rig.twins.manager.edit("r1", Edit(again=True), OPERATOR, dry_run=False)
    assert again.after.revision == 4
    await rig.work(lambda: robot.applied == 4 and robot.state == "applied")


@on_both
async def test_a_store_that_went_back_in_time_goes_on_above_what_robots_saw(rig: Rig) -> None:
    robot = await rig.robot("r1")
    await patch(rig, "r1", LIDAR)
    await rig.work(lambda: robot.applied == 1 and robot.state == "applied")
    rig.cut("r1")
    robot.newest = robot.applied = 9
    robot.document = b'{"budget":{"bytes_per_s":5000}}'
    rig.link("r1")
    await rig.work(lambda: robot.applied == 10 and robot.state == "applied")
    assert b"lidar" in robot.document
    # The same number, another document.
    rig.cut("r1")
    robot.document = b"{}"
    rig.link("r1")
    await rig.work(lambda: robot.applied == 11 and b"lidar" in robot.document)


async def test_a_lying_robot_harms_only_itself(rig: Rig) -> None:
    robot, other = await rig.robot("r1"), await rig.robot("r2")
    hostile = [
        link_pb2.TwinReport(revision=2**64 - 1, applied=2**63, state="applied"),
        link_pb2.TwinReport(revision=3, state="nonsense\0", code="\0" * 99, message="\0x" * 5000, sha256=b"x" * 99),
        link_pb2.TwinReport(revision=3, state="applied", reported=b"[1,2"),
        link_pb2.TwinReport(revision=3, state="confirming", reported=b"[" * 1000),
    ]
    for frame in hostile:
        rig.twins.on_report("r1", frame)
        if frame.state.startswith("nonsense"):  # nobody knows that it is done
            assert rig.twins.cache.reported["r1"].state == "applying"
    assert rig.twins.manager.reported_of("r1") == {}
    await rig.twins.cache.save()
    await patch(rig, "r1", LIDAR)
    await patch(rig, "r2", LIDAR)
    await rig.work(lambda: robot.applied == 4 and other.applied == 1)


async def test_reports_are_there_after_a_restart(store_url: str, tmp_path: Path) -> None:
    async with rig_on(store_url, tmp_path / "data") as one:
        robot = await one.robot("r1")
        await patch(one, "r1", LIDAR)
        await one.work(lambda: robot.applied == 1 and robot.state == "applied")
        await one.twins.close()
    async with rig_on(store_url, tmp_path / "data") as two:
        state = await two.twins.manager.state("r1")
        assert state.in_step
        assert two.twins.manager.reported_of("r1") == {"documents": 1}


async def test_what_robots_report_has_a_bound_in_memory_and_none_is_lost(rig: Rig) -> None:
    count, size = 300, 256 * 1024  # more than twin_values_bytes
    await rig.robot("r0")
    await rig.robot("last")
    values = b'{"x":"' + b"y" * (size - 10) + b'"}'
    for number in range(count):
        name = f"r{number}"
        rig.fleet.robots.get(name) or rig.fleet.add(name)
        rig.twins.on_report(name, link_pb2.TwinReport(state="applied", reported=values))
    rig.twins.on_report("last", link_pb2.TwinReport(state="applied", reported=b'{"x":1}'))
    assert rig.twins.manager.reported_of("last") == {"x": 1}
    assert rig.twins.manager.reported_of("r0") is None
    held = sum(len(rig.twins.cache.last(f"r{number}").reported) for number in range(count))  # type: ignore[union-attr]
    assert LIMITS.twin_values_bytes - 2 * size < held <= LIMITS.twin_values_bytes
    await rig.twins.cache.save()
    stored = (await rig.twins.manager.state("r0")).reported
    assert stored is not None
    assert stored.reported == values
