"""The Rollouts page over a real gateway: versions brought in waves to robots that fetch them as agents do."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AsyncExitStack
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, expect

from gateway.main import Ready
from tests.e2e.conftest import DESKTOP, PHONE, save
from tests.e2e.readable import unreadable
from tests.e2e.real.gateway import RealGateway, real_gateway
from tests.gateway.harness import ScriptedAgent
from tests.support.deployment.releases import signed_release, start_signing
from tests.support.robots.scripted_robot import MARK, Defects, StoryRobot

pytestmark = [
    pytest.mark.browser,
    pytest.mark.integration,
    pytest.mark.xdist_group("browser"),
    pytest.mark.timeout(400),
]

OpenPage = Callable[..., Page]
ROBOTS = [f"bot_{number:02}" for number in range(8)]
SETTLED_MS = 120_000


class Fleet:
    """The gateway with its robots, and the people who sign."""

    def __init__(self, gateway: RealGateway, folder: Path, defects: Defects) -> None:
        self.gateway, self.folder, self.defects = gateway, folder, defects

    def publish(self, version: str, *, defect: bool = False, node: str = "") -> None:
        """Sign a version of the agent, or of a node, and bring it to the gateway."""
        release = signed_release(self.folder, version, {MARK: b"on some robots"} if defect else None, node=node)
        headers = {"content-type": "application/zip"}
        answer = self.gateway.send("POST", "/updates/bundles", content=release.content, headers=headers)
        assert answer.is_success, answer.text
        self.gateway.ask("POST", "/updates/metadata", release.document)

    def start(self, version: str, **changes: object) -> str:
        """A rollout as a program starts it; its id."""
        order = {"version": version, "selector": "fleet=yard", "waves": ["2", "100%"], "steady_s": 0.0, **changes}
        return str(self.gateway.ask("POST", "/rollouts", order)["id"])


@pytest.fixture(scope="module")
def office(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Fleet]:
    """Three robots that never do what they are told, and the version 2.0.0; ada is an admin, bo an operator."""
    folder = tmp_path_factory.mktemp("office")

    async def more_robots(ready: Ready, stack: AsyncExitStack) -> None:
        for name in ("sim_2", "sim_3"):
            await stack.enter_async_context(ScriptedAgent(ready, name, session=name.encode().ljust(16)))

    with real_gateway(folder, more_robots=more_robots) as running:
        running.user("ada", "admin")
        running.user("bo", "operator")
        made = Fleet(running, folder / "people", Defects())
        start_signing(made.folder, running.ask("POST", "/updates/online-keys", {})["keys"])
        made.publish("2.0.0")
        yield made


@pytest.fixture
def idle(office: Fleet) -> Iterator[Fleet]:
    """There, no rollout is under way."""
    yield office
    for rollout in office.gateway.ask("GET", "/rollouts")["rollouts"]:
        if rollout["state"] in ("running", "paused", "halted"):
            office.gateway.ask("POST", f"/rollouts/{rollout['id']}/abort", {"reason": "the test is over"})


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[Fleet]:
    """Eight robots of one yard; ada is an admin, bo an operator. Of a version with a defect the third trial fails."""
    defects = Defects(good_trials=2, bad_trials=1)

    async def more_robots(ready: Ready, stack: AsyncExitStack) -> None:
        for name in ROBOTS:
            await stack.enter_async_context(StoryRobot(ready, name, tmp_path / "robots" / name, defects))

    with real_gateway(tmp_path, more_robots=more_robots) as running:
        running.user("ada", "admin")
        running.user("bo", "operator")
        for place, name in enumerate(ROBOTS):
            labels = {"fleet": "yard", "kind": "arm" if place % 2 else "cart"}
            running.ask("PATCH", f"/robots/{name}/labels", {"labels": labels})
        made = Fleet(running, tmp_path / "people", defects)
        start_signing(made.folder, running.ask("POST", "/updates/online-keys", {})["keys"])
        yield made


def page_of(
    fleet: Fleet, open_page: OpenPage, path: str = "/rollouts", *, name: str = "ada", **options: object
) -> Page:
    """Somebody's page."""
    page = open_page(fleet.gateway.url + path, link=fleet.gateway.link(name), **options)
    expect(page.locator("h1")).to_be_visible()
    return page


def state_of(page: Page, state: str) -> None:
    """Wait until the rollout shown is in that state."""
    expect(page.locator(f"[data-rollout-state={state}]")).to_be_visible(timeout=SETTLED_MS)


def wave(page: Page, number: int) -> Locator:
    """The bar of a wave."""
    return page.locator(f".card-waves [data-wave='{number}'] .wave-bar")


def test_a_rollout_halts_by_itself_and_is_mended(fleet: Fleet, open_page: OpenPage) -> None:
    fleet.publish("2.0.0", defect=True)
    page = page_of(fleet, open_page)
    expect(page.locator(".nothing")).to_contain_text("No rollout yet")
    page.get_by_role("button", name="Start a rollout…").click()
    dialog = page.get_by_role("dialog")
    expect(dialog.locator("[data-named]")).to_have_attribute("data-named", "9")
    dialog.get_by_label("Robots", exact=True).fill("fleet=(")
    expect(dialog.get_by_role("alert")).to_contain_text("terms look like")
    dialog.get_by_label("Robots", exact=True).fill("")
    dialog.get_by_role("button", name="fleet=yard").click()
    expect(dialog.get_by_label("Robots", exact=True)).to_have_value("fleet=yard")
    expect(dialog.locator("[data-named]")).to_have_attribute("data-named", "8")
    dialog.get_by_role("textbox", name="Waves").fill("2, 100%")
    dialog.get_by_text("When a robot counts as failed").click()
    dialog.get_by_label("…and for").fill("0")
    dialog.get_by_role("button", name="Dry run").click()
    plan = dialog.get_by_label("Dry run")
    expect(plan.locator("h3")).to_have_text("agent 2.0.0 to 8 robots in 2 waves")
    save(page, "rollouts-start")
    dialog.get_by_role("textbox", name="Waves").fill("2, 4, 100%")
    expect(dialog.get_by_role("button", name="Dry run")).to_be_visible()  # another plan is not started unseen
    expect(plan).to_have_count(0)
    assert fleet.gateway.ask("GET", "/rollouts")["rollouts"] == []
    dialog.get_by_role("button", name="Dry run").click()
    dialog.get_by_role("button", name="Start for 8 robots").click()
    expect(page.locator("h1")).to_have_text("agent 2.0.0")

    state_of(page, "halted")
    (bad,) = fleet.defects.failed
    expect(page.locator("[data-halted]")).to_contain_text(f"{bad} rolled_back: not healthy within its window")
    expect(wave(page, 1)).to_have_attribute("aria-label", "Wave 1: 2 done")
    expect(wave(page, 2)).to_have_attribute("aria-label", "Wave 2: 3 done, 1 failed", timeout=SETTLED_MS)
    expect(wave(page, 3)).to_have_attribute("aria-label", "Wave 3: 2 waiting")
    expect(page.locator("tr[data-member]").first).to_have_attribute("data-member", bad)
    faults = unreadable(page, "halted, desktop", shot="rollouts-halted")
    page.set_viewport_size(PHONE)  # type: ignore[arg-type]
    assert faults + unreadable(page, "halted, phone", shot="rollouts-halted-phone") == []
    page.set_viewport_size(DESKTOP)  # type: ignore[arg-type]
    page.get_by_role("button", name="failed 1").click()
    expect(page.locator("tr[data-member]")).to_have_count(1)
    assert page.url.endswith("?state=failed")
    page.get_by_role("button", name="all 8").click()

    fleet.publish("2.0.1")
    page.get_by_role("button", name="Resume…").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_role("radio", name="Begin again with 2.0.1").check()
    save(page, "rollouts-resume")
    dialog.get_by_role("button", name="Resume", exact=True).click()
    expect(page.locator("h1")).to_have_text("agent 2.0.1")
    state_of(page, "done")
    expect(page.locator("tr[data-member-state=done]")).to_have_count(8)
    save(page, "rollouts-done")
    page.get_by_role("link", name="Rollouts", exact=True).last.click()
    expect(page.locator("[data-rollout][data-state=done]")).to_have_count(1)


def test_a_nodes_version_is_for_the_node_that_runs_it(idle: Fleet, open_page: OpenPage) -> None:
    fleet = idle
    fleet.publish("1.2.0", node="lidar-node")
    row = {"bundle": "lidar-node", "version": "1.0.0"}
    fleet.gateway.ask("PUT", "/templates/nodes", {"selector": "robot=sim_3", "document": {"nodes": {"lidar": row}}})
    page = page_of(fleet, open_page)
    page.get_by_role("button", name="Start a rollout…").click()
    dialog = page.get_by_role("dialog")
    dialog.locator("select").first.select_option(label="lidar-node 1.2.0")
    expect(dialog).to_contain_text("Templates run it as lidar.")
    dialog.get_by_label("Node", exact=True).fill("lidar")
    dialog.get_by_label("Robots", exact=True).fill("robot=sim_3")
    dialog.get_by_role("button", name="Dry run").click()
    expect(dialog.get_by_label("Dry run").locator("h3")).to_have_text("lidar 1.2.0 to 1 robot in 1 wave")
    dialog.get_by_role("button", name="Start for 1 robot").click()
    expect(page.locator("h1")).to_have_text("lidar 1.2.0")
    expect(page.locator(".rollout-plan")).to_contain_text("lidar-node 1.2.0 as node lidar")
    expect(page.locator("[data-member=sim_3]")).to_have_attribute("data-member-state", "updating")
    twin = fleet.gateway.ask("GET", "/robots/sim_3/twin")
    assert twin["own"] == {"nodes": {"lidar": {"version": "1.2.0"}}}


def test_it_is_paused_resumed_and_ended_with_reasons(idle: Fleet, open_page: OpenPage) -> None:
    fleet = idle
    rid = fleet.start("2.0.0", selector="robot in (sim_1, sim_2)", waves=["1", "1"], health_s=600.0)
    page = page_of(fleet, open_page, f"/rollouts/{rid}")
    page.get_by_role("button", name="Pause…").click()
    page.get_by_role("dialog").get_by_label("Why").fill("lunch <b>break</b>")
    page.get_by_role("dialog").get_by_role("button", name="Pause").click()
    state_of(page, "paused")
    expect(page.locator(".rollout-note")).to_contain_text("lunch <b>break</b>")
    save(page, "rollouts-paused")
    page.get_by_role("button", name="Resume…").click()
    page.get_by_role("dialog").get_by_role("button", name="Resume", exact=True).click()
    state_of(page, "running")
    page.get_by_role("button", name="End it…").click()
    page.get_by_role("dialog").get_by_label("Why").fill("wrong robots")
    page.get_by_role("dialog").get_by_role("button", name="End it").click()
    state_of(page, "aborted")
    expect(page.locator(".rollout-note")).to_contain_text("wrong robots")
    expect(page.get_by_role("button", name="End it…")).to_have_count(0)


def test_an_operator_looks_and_does_not_steer(idle: Fleet, open_page: OpenPage) -> None:
    fleet = idle
    rid = fleet.start("2.0.0", selector="robot=sim_1", health_s=600.0)
    page = page_of(fleet, open_page, name="bo")
    expect(page.get_by_text("Admins may start rollouts; bo is an operator.")).to_be_visible()
    expect(page.get_by_role("button", name="Start a rollout…")).to_have_count(0)
    page.locator(f"[data-rollout='{rid}'] .rollout-link").click()
    expect(page.get_by_text("Admins may steer rollouts")).to_be_visible()
    for name in ("Pause…", "Resume…", "End it…"):
        expect(page.get_by_role("button", name=name)).to_have_count(0)
    page.goto(f"{fleet.gateway.url}/rollouts/versions")
    expect(page.locator("tr[data-bundle]", has_text="2.0.0")).to_have_count(1)
    expect(page.get_by_role("button", name="Withdraw")).to_have_count(0)


def test_versions_and_a_withdrawal(tmp_path: Path, open_page: OpenPage) -> None:
    with real_gateway(tmp_path) as running:
        running.user("ada", "admin")
        fleet = Fleet(running, tmp_path / "people", Defects())
        start_signing(fleet.folder, running.ask("POST", "/updates/online-keys", {})["keys"])
        withdraw_a_version(fleet, open_page)


def withdraw_a_version(fleet: Fleet, open_page: OpenPage) -> None:
    """From none to two, one of them withdrawn."""
    page = page_of(fleet, open_page, "/rollouts/versions")
    expect(page.locator(".nothing")).to_contain_text("No version is uploaded yet")
    for version in ("2.9.0", "2.10.0"):
        fleet.publish(version)
    page.reload()
    rows = page.locator("tr[data-bundle]")
    expect(rows.locator("[data-label=Version]")).to_have_text(["2.10.0", "2.9.0"])
    expect(rows.first).to_contain_text("ready")
    expect(page.locator("[data-role=targets]")).to_contain_text("people sign it, offline")
    rows.first.get_by_role("button", name="Withdraw").click()
    page.get_by_role("dialog").get_by_label("Why").fill("burns motors")
    page.get_by_role("dialog").get_by_role("button", name="Withdraw").click()
    expect(rows.first).to_contain_text("withdrawn")
    expect(rows.first).to_contain_text("burns motors")
    save(page, "rollouts-versions")
    page.goto(f"{fleet.gateway.url}/rollouts")
    page.get_by_role("button", name="Start a rollout…").click()
    expect(page.get_by_role("dialog").locator("option")).to_have_text(["agent 2.9.0"])


def test_it_fits_a_phone_and_can_be_read(idle: Fleet, open_page: OpenPage) -> None:
    fleet = idle
    rid = fleet.start("2.0.0", selector="robot in (sim_1, sim_2)", waves=["1", "1"], health_s=600.0)
    desktop = page_of(fleet, open_page, f"/rollouts/{rid}")
    phone = page_of(fleet, open_page, size=PHONE, touch=True)
    faults = []
    for page, word in ((desktop, "desktop"), (phone, "phone")):
        for path, name in (("/rollouts", "list"), (f"/rollouts/{rid}", "one"), ("/rollouts/versions", "versions")):
            page.goto(fleet.gateway.url + path)
            expect(page.locator("[data-rollout], [data-member], [data-bundle]").first).to_be_visible()
            faults += unreadable(page, f"{word} {name}", shot=f"rollouts-{name}-{word}")
    phone.goto(f"{fleet.gateway.url}/rollouts")
    phone.get_by_role("button", name="Start a rollout…").click()
    expect(phone.get_by_role("dialog").locator("[data-named]")).to_be_visible()
    assert faults + unreadable(phone, "start", shot="rollouts-start-phone") == []


def test_markup_in_labels_and_reasons_is_harmless(idle: Fleet, open_page: OpenPage) -> None:
    fleet = idle
    rid = fleet.start("2.0.0", selector="robot=sim_1", health_s=600.0)
    fleet.gateway.ask("POST", f"/rollouts/{rid}/pause", {"reason": "<img src=x onerror='window.__ran=1'>"})
    page = page_of(fleet, open_page)
    expect(page.locator(f"[data-rollout='{rid}']")).to_contain_text("<img src=x")
    page.goto(f"{fleet.gateway.url}/rollouts/{rid}")
    expect(page.locator(".rollout-note")).to_contain_text("<img src=x")
    assert page.evaluate("window.__ran") is None
    assert page.locator("main img").count() == 0


def test_what_is_no_rollout_is_said(idle: Fleet, open_page: OpenPage) -> None:
    fleet = idle
    page = page_of(fleet, open_page, "/rollouts/nonsense")
    expect(page.locator(".nothing")).to_have_text("There is no such rollout.")
    page.goto(f"{fleet.gateway.url}/rollouts/{'0' * 26}")
    expect(page.get_by_role("alert")).to_contain_text("there is no rollout")
