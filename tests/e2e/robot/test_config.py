"""The Config tab over a real gateway, with a robot that does what its twin says, or does not."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.e2e.conftest import DESKTOP, PHONE
from tests.e2e.readable import save, unreadable
from tests.e2e.real.gateway import RealGateway, real_gateway
from tests.e2e.real.scripted_robot import ScriptedRobot, scripted_robot

pytestmark = [
    pytest.mark.browser,
    pytest.mark.integration,
    pytest.mark.xdist_group("browser"),
    pytest.mark.timeout(600),
]

OpenPage = Callable[..., Page]
PICTURED = {"test_an_edit_is_tried_then_applied_and_the_robot_does_it": "arm_1"}
ARM = {
    "topics": {"camera/**": {"class": "live", "rate_hz": 5.0}},
    "parameters": {"/arm_1/lidar": {"rate_hz": 10.0, "frame": "laser"}},
    "lifecycle": {"/arm_1/lidar": "active"},
}


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RealGateway]:
    with real_gateway(tmp_path_factory.mktemp("config")) as gateway:
        gateway.user("ada", "operator")
        gateway.user("vic", "viewer")
        yield gateway


@pytest.fixture
def robot(served: RealGateway, request: pytest.FixtureRequest) -> Iterator[ScriptedRobot]:
    """A robot of each test's own."""
    name = PICTURED.get(request.node.name) or re.sub(r"\W+", "_", request.node.name)[-40:]
    with scripted_robot(served.ready, name) as lives:
        yield lives


def opened(gateway: RealGateway, open_page: OpenPage, robot: str, *, who: str = "", **options: object) -> Page:
    """The tab, to an admin or to somebody else."""
    page = open_page(f"{gateway.url}/robots/{robot}?tab=config", link=gateway.link(who), **options)
    expect(page.locator("[data-standing]")).to_be_visible()
    return page


def standing(page: Page, step: str, revision: int) -> Locator:
    """The card on top, once it says so."""
    card = page.locator(f"[data-standing={step}][data-revision='{revision}']")
    expect(card).to_be_visible()
    return card


def test_desired_and_real_stand_side_by_side(served: RealGateway, open_page: OpenPage, robot: ScriptedRobot) -> None:
    served.ask("PUT", f"/robots/{robot.name}/twin?reason=first", ARM)
    lidar = {"state": "waiting", "values": {"rate_hz": 8.0, "frame": "laser"}, "message": "waits for the node"}
    robot.report(parameters={"/arm_1/lidar": lidar}, lifecycle={"/arm_1/lidar": {"state": "active"}})
    page = opened(served, open_page, robot.name)
    card = standing(page, "in_step", 1)
    expect(card).to_contain_text("The robot lives by revision 1.")
    rate = page.locator("[data-key='parameters./arm_1/lidar.rate_hz']")
    expect(rate).to_have_attribute("data-mark", "change")
    expect(rate).to_contain_text("10.0")
    expect(rate).to_contain_text("8.0")
    expect(rate).to_contain_text("waits for the node")
    expect(page.locator("[data-key='lifecycle./arm_1/lidar']")).to_have_attribute("data-mark", "same")
    page.get_by_role("button", name="Differences").click()
    expect(page.locator("[data-mark]")).to_have_count(1)
    expect(page.locator("[data-card=history] [data-entry]")).to_have_count(1)
    expect(page.locator("[data-card=history]")).to_contain_text("first")


def test_an_edit_is_tried_then_applied_and_the_robot_does_it(
    served: RealGateway, open_page: OpenPage, robot: ScriptedRobot
) -> None:
    served.ask("PUT", f"/robots/{robot.name}/twin", ARM)
    page = opened(served, open_page, robot.name, who="ada")
    standing(page, "in_step", 1)
    page.get_by_role("button", name="Edit", exact=True).click()
    field = page.locator("[data-field='topics.camera/**.rate_hz']")
    field.get_by_role("textbox").fill("-3")
    expect(field).to_contain_text("0 to 1000000")
    expect(page.get_by_role("button", name="Show what would change")).to_be_disabled()
    field.get_by_role("textbox").fill("2.5")
    page.get_by_label("Set another key of topics camera/**").select_option("latest_only")
    page.get_by_role("switch", name="latest_only").check()
    page.get_by_label("Reason").fill("less of the camera")
    page.get_by_role("button", name="15 s").click()
    page.get_by_role("button", name="Show what would change").click()
    plan = page.locator("[data-plan]")
    expect(plan).to_contain_text(f"{robot.name} would change")
    expect(plan.locator("[data-path='/topics/camera~1**/rate_hz']")).to_contain_text("5.0")
    expect(plan.locator("[data-path='/topics/camera~1**/rate_hz']")).to_contain_text("2.5")
    expect(plan.locator(".change")).to_have_count(2)
    assert served.ask("GET", f"/robots/{robot.name}/twin")["revision"] == 1, "nothing is stored by looking"
    save(page, "config-plan", whole=True)
    page.get_by_role("button", name=f"Apply to {robot.name}").click()
    standing(page, "in_step", 2)
    assert robot.document["topics"]["camera/**"] == {"class": "live", "rate_hz": 2.5, "latest_only": True}
    assert isinstance(robot.document["parameters"]["/arm_1/lidar"]["rate_hz"], float), "10.0 is still no 10"
    expect(page.locator("[data-card=history] [data-entry='2']")).to_contain_text("less of the camera")
    expect(page.locator("[data-card=history] [data-entry='2']")).to_contain_text("ada")


def test_json_is_edited_too_and_its_mistakes_are_named(
    served: RealGateway, open_page: OpenPage, robot: ScriptedRobot
) -> None:
    served.ask("PUT", f"/robots/{robot.name}/twin", ARM)
    page = opened(served, open_page, robot.name)
    page.get_by_role("button", name="Edit", exact=True).click()
    page.get_by_role("button", name="JSON").click()
    text = page.get_by_label("The robot's own document")
    assert '"rate_hz": 10.0' in text.input_value()
    text.press("End")
    page.keyboard.type("/?")  # elsewhere these are keys of the page
    expect(page.get_by_role("dialog")).to_have_count(0)
    expect(text).to_be_focused()
    text.fill('{"topics": ')
    expect(page.locator(".card-editor .value-field, .card-editor .json + small")).to_contain_text("JSON")
    expect(page.get_by_role("button", name="Show what would change")).to_be_disabled()
    text.fill('{"topics": {"scan": {"clas": "live"}}}')
    page.get_by_role("button", name="Show what would change").click()
    expect(page.get_by_role("alert")).to_contain_text("did you mean 'class'?")
    text.fill('{"topics": {"scan": {"class": "live"}}, "budget": {"bytes_per_s": 250000}}')
    expect(page.get_by_role("alert")).to_have_count(0)
    page.get_by_role("button", name="Show what would change").click()
    expect(page.locator("[data-plan] .change-remove").first).to_be_visible()
    expect(page.locator("[data-plan] [data-path='/budget/bytes_per_s']")).to_contain_text("250000")
    page.get_by_role("button", name="Form").click()
    expect(page.locator("[data-field='budget.bytes_per_s'] input")).to_have_value("250000")


def test_a_trial_counts_down_and_ends_well(served: RealGateway, open_page: OpenPage, robot: ScriptedRobot) -> None:
    page = opened(served, open_page, robot.name)
    standing(page, "none", 0)
    robot.mood = "linger"
    served.ask("PUT", f"/robots/{robot.name}/twin?confirm_within_s=600", ARM)
    card = standing(page, "applying", 1)
    expect(card.locator("[data-countdown]")).to_contain_text(re.compile(r"goes back in \d+ s"))
    save(page, "config-trial", whole=True)
    first = int(card.locator("[data-countdown]").get_attribute("data-countdown") or "0")
    assert 0 < first <= 600
    page.wait_for_function(
        "first => Number(document.querySelector('[data-countdown]').dataset.countdown) < first", arg=first
    )
    robot.run(robot.confirm())
    standing(page, "in_step", 1)
    expect(page.locator("[data-countdown]")).to_have_count(0)


@pytest.mark.parametrize("mood", ["revert", "refuse"])
def test_what_the_robot_did_not_keep_is_said_plainly_and_can_be_tried_again(
    served: RealGateway, open_page: OpenPage, robot: ScriptedRobot, mood: str
) -> None:
    served.ask("PUT", f"/robots/{robot.name}/twin", ARM)
    page = opened(served, open_page, robot.name)
    standing(page, "in_step", 1)
    robot.mood = mood  # type: ignore[assignment]
    served.ask("PATCH", f"/robots/{robot.name}/twin", {"budget": {"bytes_per_s": 20000}})
    card = standing(page, "reverted" if mood == "revert" else "refused", 2)
    said = "no confirmation within 15 s" if mood == "revert" else "does not allow free commands"
    expect(card).to_contain_text(said)
    expect(card).to_contain_text("It lives by revision 1")
    expect(card.locator("[data-path='/budget/bytes_per_s']")).to_contain_text("20000")
    expect(page.locator("[data-key='budget.bytes_per_s']")).to_have_attribute("data-mark", "add")
    save(page, f"config-{mood}", whole=True)
    robot.mood = "take"
    page.get_by_role("button", name="Try it again").click()
    standing(page, "in_step", 3)


def test_the_history_leads_back(served: RealGateway, open_page: OpenPage, robot: ScriptedRobot) -> None:
    served.ask("PUT", f"/robots/{robot.name}/twin", ARM)
    served.ask("PATCH", f"/robots/{robot.name}/twin", {"lifecycle": None, "budget": {"bytes_per_s": 99999}})
    page = opened(served, open_page, robot.name)
    standing(page, "in_step", 2)
    entry = page.locator("[data-entry='1']")
    entry.locator("summary").click()
    entry.get_by_role("button", name="Go back to this").click()
    tried = entry.locator("[data-tried]")
    expect(tried.locator(".change-add")).to_contain_text("active")
    expect(tried.locator(".change-remove")).to_contain_text("99999")
    tried.get_by_role("button", name="Go back", exact=True).click()
    standing(page, "in_step", 3)
    assert robot.document == ARM


def test_somebody_elses_change_is_not_overwritten(
    served: RealGateway, open_page: OpenPage, robot: ScriptedRobot
) -> None:
    served.ask("PUT", f"/robots/{robot.name}/twin", ARM)
    page = opened(served, open_page, robot.name)
    page.get_by_role("button", name="Edit", exact=True).click()
    page.locator("[data-field='topics.camera/**.rate_hz'] input").fill("1.5")
    served.ask("PATCH", f"/robots/{robot.name}/twin", {"budget": {"bytes_per_s": 50000}})
    expect(page.get_by_role("alert")).to_contain_text("at revision 2 now")
    expect(page.get_by_role("button", name="Show what would change")).to_be_disabled()
    page.get_by_role("button", name="Carry my changes over").click()
    page.get_by_role("button", name="Show what would change").click()
    expect(page.locator("[data-plan] .change")).to_have_count(1)
    page.get_by_role("button", name=f"Apply to {robot.name}").click()
    standing(page, "in_step", 3)
    assert robot.document["budget"] == {"bytes_per_s": 50000}
    assert robot.document["topics"]["camera/**"]["rate_hz"] == 1.5


def test_what_templates_say_is_marked_changed_here_and_taken_away(
    served: RealGateway, open_page: OpenPage, robot: ScriptedRobot
) -> None:
    document = {"topics": {"scan": {"class": "live", "rate_hz": 5.0}, "imu": {"class": "bulk"}}}
    template = {"selector": f"robot={robot.name}", "document": document}
    served.ask("PUT", "/templates/lab", template)
    served.ask("PUT", f"/robots/{robot.name}/twin", {"topics": {"own": {"class": "live"}}})
    page = opened(served, open_page, robot.name)
    standing(page, "in_step", 2)
    expect(page.locator("[data-standing]")).to_contain_text(re.compile(r"lab@\d"))
    expect(page.locator("[data-key='topics.scan.rate_hz']")).to_contain_text("template")
    expect(page.locator("[data-key='topics.own.class']")).not_to_contain_text("template")
    page.get_by_role("button", name="Edit", exact=True).click()
    scan = page.locator("[data-row=scan]")
    scan.get_by_role("button", name="rate_hz: 5.0").click()
    page.locator("[data-field='topics.scan.rate_hz'] input").fill("1.0")
    page.get_by_role("button", name="Take imu away").click()
    expect(page.locator("[data-row=imu]")).to_contain_text("taken away here")
    page.get_by_role("button", name="Take own away").click()
    expect(page.locator("[data-row=own]")).to_have_count(0)
    page.get_by_role("button", name="Show what would change").click()
    plan = page.locator("[data-plan]")
    expect(plan.locator(".change-remove")).to_have_count(2)
    expect(plan.locator(".change-change")).to_contain_text("1.0")
    page.get_by_role("button", name=f"Apply to {robot.name}").click()
    standing(page, "in_step", 3)
    assert robot.document == {"topics": {"scan": {"class": "live", "rate_hz": 1.0}}}
    own = served.ask("GET", f"/robots/{robot.name}/twin")["own"]
    assert own == {"topics": {"scan": {"rate_hz": 1.0}, "imu": None}}
    served.ask("DELETE", "/templates/lab")


def test_a_draft_outlives_a_look_at_another_tab(served: RealGateway, open_page: OpenPage, robot: ScriptedRobot) -> None:
    served.ask("PUT", f"/robots/{robot.name}/twin", ARM)
    page = opened(served, open_page, robot.name)
    page.get_by_role("button", name="Edit", exact=True).click()
    page.locator("[data-field='topics.camera/**.rate_hz'] input").fill("1.5")
    page.get_by_role("button", name="Nodes").click()
    expect(page.locator(".nothing")).to_contain_text("runs no nodes")
    page.get_by_role("button", name="Config").click()
    expect(page.locator("[data-field='topics.camera/**.rate_hz'] input")).to_have_value("1.5")
    page.get_by_role("button", name="Cancel").click()
    expect(page.locator("[data-card=editor]")).to_have_count(0)


def test_an_operator_changes_no_code_and_the_form_says_so(
    served: RealGateway, open_page: OpenPage, robot: ScriptedRobot
) -> None:
    served.ask("PUT", f"/robots/{robot.name}/twin", {"nodes": {"lidar": {"allowed": "lidar-driver", "nice": 0}}})
    page = opened(served, open_page, robot.name, who="ada")
    page.get_by_role("button", name="Edit", exact=True).click()
    code = page.locator("[data-field='nodes.lidar.allowed']")
    expect(code.get_by_role("textbox")).to_be_disabled()
    expect(code).to_contain_text("an admin's to say")
    expect(page.get_by_placeholder("name of a node")).to_have_count(0)
    page.locator("[data-field='nodes.lidar.nice']").get_by_role("textbox").fill("5")
    page.get_by_role("button", name="JSON").click()
    text = page.get_by_label("The robot's own document")
    text.fill(text.input_value().replace("lidar-driver", "shell"))  # who types it is refused by the gateway
    page.get_by_role("button", name="Show what would change").click()
    expect(page.get_by_role("alert")).to_contain_text("needs nodes.code")
    text.fill(text.input_value().replace("shell", "lidar-driver"))
    page.get_by_role("button", name="Show what would change").click()
    page.get_by_role("button", name=f"Apply to {robot.name}").click()
    standing(page, "in_step", 2)
    assert robot.document["nodes"]["lidar"] == {"allowed": "lidar-driver", "nice": 5}


def test_several_robots_are_changed_at_once_after_their_names_were_seen(
    served: RealGateway, open_page: OpenPage, robot: ScriptedRobot
) -> None:
    with scripted_robot(served.ready, f"{robot.name[:30]}_two") as other:
        page = opened(served, open_page, robot.name)
        page.get_by_role("button", name="Edit", exact=True).click()
        page.locator("[data-section=budget] select.add-key").evaluate("node => node.closest('details').open = true")
        page.get_by_label("Set another key of budget").select_option("bytes_per_s")
        page.locator("[data-field='budget.bytes_per_s'] input").fill("30000")
        page.get_by_role("button", name="Several robots").click()
        page.get_by_label("Which robots").fill(f"robot in ({robot.name}, {other.name})")
        page.get_by_role("button", name="Show what would change").click()
        plan = page.locator("[data-plan='2']")
        expect(plan).to_contain_text("2 of 2 robots would change")
        expect(plan).to_contain_text(", ".join(sorted([robot.name, other.name])))
        page.get_by_role("button", name="Apply to 2 robots").click()
        standing(page, "in_step", 1)
        page.goto(f"{served.url}/robots/{other.name}?tab=config")
        standing(page, "in_step", 1)
        assert other.document == robot.document == {"budget": {"bytes_per_s": 30000}}


def test_a_viewer_sees_all_of_it_and_changes_nothing(
    served: RealGateway, open_page: OpenPage, robot: ScriptedRobot
) -> None:
    served.ask("PUT", f"/robots/{robot.name}/twin", ARM)
    served.ask("PATCH", f"/robots/{robot.name}/twin", {"lifecycle": None})
    page = opened(served, open_page, robot.name, who="vic")
    standing(page, "in_step", 2)
    expect(page.locator("[data-may-not]")).to_contain_text("vic is a viewer")
    expect(page.get_by_role("button", name="Edit", exact=True)).to_have_count(0)
    entry = page.locator("[data-entry='1']")
    entry.locator("summary").click()
    expect(entry.locator(".change").first).to_be_visible()
    expect(entry.get_by_role("button")).to_have_count(0)


def test_it_fits_a_phone_and_can_be_read(served: RealGateway, open_page: OpenPage, robot: ScriptedRobot) -> None:
    served.ask("PUT", f"/robots/{robot.name}/twin?reason=first", ARM)
    robot.report(parameters={"/arm_1/lidar": {"values": {"rate_hz": 8.0, "frame": "laser"}}})
    robot.mood = "revert"
    served.ask("PATCH", f"/robots/{robot.name}/twin?reason=less", {"budget": {"bytes_per_s": 20000}, "lifecycle": None})
    faults = []
    for size, touch, word in ((DESKTOP, False, "desktop"), (PHONE, True, "phone")):
        page = opened(served, open_page, robot.name, size=size, touch=touch)
        standing(page, "reverted", 2)
        faults += unreadable(page, word, shot=f"config-{word}", whole=True)
        page.get_by_role("button", name="Edit", exact=True).click()
        expect(page.locator("[data-section=topics]")).to_be_visible()
        faults += unreadable(page, f"{word}, editing", shot=f"config-edit-{word}", whole=True)
    assert faults == []
