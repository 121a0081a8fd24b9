"""The Nodes tab: over the real programs with a node that has parameters and a lifecycle, and over a scripted robot."""

from __future__ import annotations

import datetime
import json
import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, expect

from metaros._proto import link_pb2
from metaros.supervise.client import ask
from metaros.supervise.program import running_pid
from tests.e2e.admin.test_admin import link
from tests.e2e.conftest import DESKTOP, PHONE
from tests.e2e.readable import save, unreadable
from tests.e2e.real.gateway import RealGateway, real_gateway, real_stack
from tests.e2e.real.scripted_robot import ScriptedRobot, scripted_robot
from tests.support.waiting import wait_until
from tests.system.nodes.test_remote_nodes import ROBOT, RemoteRobot

pytestmark = [
    pytest.mark.browser,
    pytest.mark.integration,
    pytest.mark.xdist_group("browser"),
    pytest.mark.timeout(900),
]

OpenPage = Callable[..., Page]


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RemoteRobot]:
    """Agent, supervisor and a lidar, all of them processes, and a gateway."""
    with real_stack(tmp_path_factory.mktemp("nodes")) as stack:
        stack.router()
        found = RemoteRobot(stack)
        try:
            wait_until(lambda: stack.online() == {ROBOT}, timeout_s=120)
            found.on("PUT", "/lidar", {"allowed": "lidar-driver", "parameters": {"beams": 180}})
            found.runs("lidar")
            yield found
        finally:
            if running_pid(found.state) is not None:
                ask(found.state, "shutdown")
                wait_until(lambda: running_pid(found.state) is None)


def opened(robot: RemoteRobot, open_page: OpenPage, **query: str) -> Page:
    """The tab, to an admin."""
    asked = "".join(f"&{name}={value}" for name, value in query.items())
    page = open_page(f"{robot.stack.url}/robots/{ROBOT}?tab=nodes{asked}", link=link(robot.stack))
    expect(page.locator("[data-node=lidar]")).to_be_visible()
    return page


def row(page: Page, node: str, state: str) -> Locator:
    """A node's row, once it is in that state."""
    found = page.locator(f"[data-node={node}][data-state={state}]")
    expect(found).to_be_visible()
    return found


def test_a_node_is_restarted_stopped_and_started(robot: RemoteRobot, open_page: OpenPage) -> None:
    first = robot.runs("lidar")
    page = opened(robot, open_page)
    lidar = row(page, "lidar", "running")
    expect(lidar).to_contain_text(str(first))
    lidar.get_by_role("button", name="Restart lidar").click()
    expect(page.get_by_role("status").filter(has_text="lidar was restarted.")).to_be_visible()
    wait_until(lambda: robot.pid("lidar") not in (None, first), timeout_s=120)
    expect(lidar).to_contain_text(str(robot.runs("lidar")))
    lidar.get_by_role("button", name="Stop lidar").click()
    stopped = row(page, "lidar", "stopped")
    expect(stopped).to_have_attribute("data-step", "true")
    assert robot.node("lidar")["desired"]["run"] is False, "it lasts"
    stopped.get_by_role("button", name="Start lidar").click()
    row(page, "lidar", "running")


def test_the_log_is_followed_and_searched(robot: RemoteRobot, open_page: OpenPage) -> None:
    pid = robot.runs("lidar")
    page = opened(robot, open_page)
    page.get_by_role("button", name="lidar", exact=True).click()
    log = page.get_by_role("log")
    expect(log).to_contain_text(f"lidar started as {pid}")
    expect(page.locator("[data-follow=live]")).to_be_visible()
    robot.on("POST", "/lidar/restart", {})
    wait_until(lambda: robot.pid("lidar") not in (None, pid), timeout_s=120)
    expect(log).to_contain_text(f"lidar started as {robot.runs('lidar')}")  # it came by itself
    expect(log.locator(".log-line", has_text=f"started as {pid}")).to_have_count(1)
    page.get_by_label("Search the log").fill(f"STARTED as {pid}")
    expect(log.locator(".log-line")).to_have_count(1)
    expect(log.locator("mark")).to_have_text(f"started as {pid}")
    page.get_by_label("Search the log").fill("no such words")
    expect(log).to_contain_text("No line holds")


def test_parameters_are_typed_bounded_set_and_kept(robot: RemoteRobot, open_page: OpenPage) -> None:
    robot.runs("lidar")
    page = opened(robot, open_page, node="lidar", view="parameters")
    rate, serial = page.locator("[data-parameter=rate_hz]"), page.locator("[data-parameter=serial]")
    expect(rate).to_contain_text("1 to 20")
    expect(rate).to_contain_text("turns a second")
    expect(serial.get_by_role("textbox")).to_be_disabled()
    expect(serial).to_contain_text("read-only")
    expect(page.locator("[data-parameter=frames] textarea")).to_have_value("laser\nbase")
    rate.get_by_role("textbox").fill("99")
    expect(page.get_by_role("button", name="Set", exact=True)).to_be_disabled()
    rate.get_by_role("textbox").fill("12")
    page.locator("[data-parameter=beams]").get_by_role("textbox").fill("1.5")
    expect(page.locator("[data-parameter=beams]")).to_contain_text("without a point")
    page.locator("[data-parameter=beams]").get_by_role("textbox").fill("90")
    page.get_by_label("Keep: also after the node starts again").check()
    save(page, "nodes-parameters", whole=True)
    page.get_by_role("button", name="Set 2 values").click()
    expect(page.get_by_role("button", name="Set", exact=True)).to_be_disabled()
    expect(page.locator(".parameter-changed")).to_have_count(0)
    values = {item["name"]: item for item in robot.on("GET", "/lidar/parameters")["parameters"]}
    assert (values["rate_hz"]["value"], values["beams"]["value"]) == (12.0, 90)
    assert values["rate_hz"]["desired"] == 12.0


def test_a_lifecycle_is_driven_step_by_step(robot: RemoteRobot, open_page: OpenPage) -> None:
    robot.runs("lidar")
    page = opened(robot, open_page, node="lidar", view="lifecycle")
    expect(page.locator("[data-lifecycle=unconfigured]")).to_be_visible()
    page.get_by_role("button", name="Configure").click()
    expect(page.locator("[data-lifecycle=inactive]")).to_be_visible()
    page.get_by_role("button", name="Activate").click()
    expect(page.locator("[data-lifecycle=active]")).to_be_visible()
    expect(page.locator(".states [aria-current]")).to_have_text("active")
    expect(page.get_by_role("status").filter(has_text="it is active now")).to_be_visible()
    save(page, "nodes-lifecycle", whole=True)
    page.get_by_role("button", name="Shutdown").click()
    page.get_by_role("dialog").get_by_role("button", name="Cancel").click()
    assert robot.on("GET", "/lidar/lifecycle")["state"] == "active"


# -- a scripted robot: states that are hard to come by -----------------------------------------------------------------

NODES = {
    "lidar": {"bundle": "lidar-node", "version": "1.3.0", "critical": True, "nice": -5},
    "planner": {"allowed": "planner", "migratable": True},
    "camera": {"allowed": "camera-driver"},
    "mapper": {"allowed": "mapper", "run": False},
}


def said(boot_s: float) -> dict[str, Any]:
    """What the robot reports of them; they began so many seconds ago."""
    began = int((datetime.datetime.now(datetime.UTC).timestamp() - boot_s) * 1e9)
    update = {"state": "trying", "version": "1.3.0", "code": "", "message": ""}
    return {
        "lidar": {"state": "running", "pid": 411, "restarts": 2, "since_ns": began, "version": "1.2.0", "nice": -5}
        | {"quarantined": False, "crashes": 2, "update": update},
        "planner": {"state": "stopped", "why": "no lease", "restarts": 0, "quarantined": False, "crashes": 0},
        "camera": {
            "state": "quarantined",
            "restarts": 5,
            "last_exit": "exit code 1",
            "quarantined": True,
            "crashes": 6,
        },
        "mapper": {"state": "stopped", "why": "not to run", "restarts": 0, "quarantined": False, "crashes": 0},
    }


LINES = [
    "[INFO] [camera]: opening /dev/video0",
    "[WARN] [camera]: no answer, trying again",
    "[ERROR] [camera]: cannot open /dev/video0: <no such device>",
]


def answer(command: link_pb2.Command) -> bytes | str:
    """Of a robot whose camera is not there."""
    stamp = 1_795_000_000_000_000_000
    if command.WhichOneof("action") == "read_log":
        lines = [{"at_ns": stamp + i * 10**9, "text": text} for i, text in enumerate(LINES)]
        first = not command.read_log.cursor
        return json.dumps({"lines": lines if first else [], "cursor": "900", "more": False}).encode()
    if command.node_verb.verb == "crashes":
        report = {"at_ns": stamp, "reason": "exit code 1", "pid": 77, "ran_s": 0.4, "version": "", "lines": LINES}
        report |= {"argv": ["camera-driver", "--fast"], "env": {"PATH": "/usr/bin"}}
        return json.dumps({"crashes": [report]}).encode()
    return b""


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RealGateway]:
    with real_gateway(tmp_path_factory.mktemp("scripted")) as gateway:
        gateway.user("vic", "viewer")
        yield gateway


@pytest.fixture(scope="module")
def arm(served: RealGateway) -> Iterator[ScriptedRobot]:
    with scripted_robot(served.ready, "arm_1") as robot:
        robot.answer = answer
        robot.report(nodes=said(75.0))
        served.ask("PUT", "/robots/arm_1/twin", {"nodes": NODES})
        yield robot


def looked(gateway: RealGateway, open_page: OpenPage, *, who: str = "", query: str = "", **options: object) -> Page:
    page = open_page(f"{gateway.url}/robots/arm_1?tab=nodes{query}", link=gateway.link(who), **options)
    expect(page.locator("[data-node]")).to_have_count(4)
    return page


def test_what_is_not_as_desired_says_why(served: RealGateway, open_page: OpenPage, arm: ScriptedRobot) -> None:
    page = looked(served, open_page)
    lidar = row(page, "lidar", "running")
    expect(lidar).to_contain_text("critical")
    expect(lidar).to_contain_text("1.3.0 is desired")
    expect(lidar).to_contain_text(re.compile(r"1 min|\d\d s"))
    camera = row(page, "camera", "quarantined")
    expect(camera).to_contain_text("exit code 1")
    expect(camera.get_by_role("button", name="Try again camera")).to_be_visible()
    expect(row(page, "mapper", "stopped")).to_have_attribute("data-step", "true")
    camera.get_by_role("button", name="Try again camera").click()
    expect(page.get_by_role("status").filter(has_text="camera is tried again.")).to_be_visible()
    verbs = [item.node_verb for item in arm.commands if item.WhichOneof("action") == "node_verb"]
    assert [(item.node, item.verb) for item in verbs if item.verb == "retry"] == [("camera", "retry")]


def test_a_critical_node_is_stopped_only_when_somebody_says_so_twice(
    served: RealGateway, open_page: OpenPage, arm: ScriptedRobot
) -> None:
    page = looked(served, open_page)
    row(page, "lidar", "running").get_by_role("button", name="Stop lidar").click()
    dialog = page.get_by_role("dialog", name="Stop lidar?")
    expect(dialog).to_contain_text("critical")
    dialog.get_by_role("button", name="Cancel").click()
    assert "run" not in served.ask("GET", "/robots/arm_1/twin")["own"]["nodes"]["lidar"]


def test_the_last_words_of_a_crash_are_there_and_harmless(
    served: RealGateway, open_page: OpenPage, arm: ScriptedRobot
) -> None:
    page = looked(served, open_page, query="&node=camera&view=crashes")
    crash = page.locator("[data-crash='77']")
    expect(crash).to_contain_text("exit code 1")
    expect(crash.locator(".last-words")).to_contain_text("<no such device>")
    expect(crash).to_contain_text("camera-driver --fast")
    save(page, "nodes-crash", whole=True)
    page.get_by_role("button", name="Log", exact=True).click()
    expect(page.locator(".log-error")).to_contain_text("<no such device>")
    expect(page).to_have_url(re.compile(r"node=camera$"))


def test_a_viewer_reads_and_does_nothing(served: RealGateway, open_page: OpenPage, arm: ScriptedRobot) -> None:
    page = looked(served, open_page, who="vic", query="&node=camera")
    expect(page.locator("[data-may-not]")).to_contain_text("vic is a viewer")
    expect(page.locator("[data-node] .cell-actions button")).to_have_count(0)
    expect(page.get_by_role("log")).to_contain_text("opening /dev/video0")
    expect(page.get_by_role("button", name="Send signal")).to_have_count(0)


def test_it_fits_a_phone_and_can_be_read(served: RealGateway, open_page: OpenPage, arm: ScriptedRobot) -> None:
    faults = []
    for size, touch, word in ((DESKTOP, False, "desktop"), (PHONE, True, "phone")):
        page = looked(served, open_page, query="&node=camera", size=size, touch=touch)
        expect(page.get_by_role("log")).to_contain_text("trying again")
        faults += unreadable(page, word, shot=f"nodes-{word}", whole=True)
    assert faults == []


def test_an_offline_robots_nodes_are_greyed_and_start_later(served: RealGateway, open_page: OpenPage) -> None:
    with scripted_robot(served.ready, "gone_1") as robot:
        served.ask("PUT", "/robots/gone_1/twin", {"nodes": {"mapper": {"allowed": "mapper", "run": False}}})
        robot.report(nodes={"mapper": said(0)["mapper"]})
        wait_until(lambda: served.ask("GET", "/robots/gone_1/nodes")["nodes"][0]["state"] == "stopped")
        wait_until(lambda: served.ask("GET", "/robots/gone_1/twin")["in_step"])
    wait_until(lambda: not served.ask("GET", "/robots/gone_1/nodes")["online"])
    page = open_page(f"{served.url}/robots/gone_1?tab=nodes", link=served.link())
    mapper = row(page, "mapper", "stopped")
    expect(mapper).to_contain_text("last known")
    expect(page.locator(".nodes-head")).to_contain_text("The robot is offline")
    mapper.get_by_role("button", name="Start mapper").click()
    expect(page.get_by_role("status").filter(has_text="when it is back")).to_be_visible()
    assert served.ask("GET", "/robots/gone_1/twin")["own"]["nodes"]["mapper"]["run"] is not False
