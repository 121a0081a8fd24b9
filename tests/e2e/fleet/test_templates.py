"""Templates over a real gateway: what they would change is shown before, and robots live by them after."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.conftest import PHONE, save
from tests.e2e.readable import unreadable
from tests.e2e.real.gateway import RealGateway, real_gateway
from tests.e2e.real.scripted_robot import ScriptedRobot, scripted_robot
from tests.support.waiting import wait_until

pytestmark = [
    pytest.mark.browser,
    pytest.mark.integration,
    pytest.mark.xdist_group("browser"),
    pytest.mark.timeout(300),
]

OpenPage = Callable[..., Page]
CAMERA = '{"topics": {"camera/**": {"class": "live", "rate_hz": 5.0}}}'


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RealGateway]:
    """ada is an admin, bo an operator."""
    with real_gateway(tmp_path_factory.mktemp("templates")) as running:
        running.user("ada", "admin")
        running.user("bo", "operator")
        yield running


@pytest.fixture
def gateway(served: RealGateway) -> Iterator[RealGateway]:
    """It, without templates."""
    yield served
    for template in served.ask("GET", "/templates")["templates"]:
        served.ask("DELETE", f"/templates/{template['name']}")


@pytest.fixture
def robot(gateway: RealGateway, request: pytest.FixtureRequest) -> Iterator[ScriptedRobot]:
    """A robot of the test's own, at the lab as long as it is there."""
    name = f"arm_{request.node.name.removeprefix('test_')}"
    with scripted_robot(gateway.ready, name) as lives:
        gateway.ask("PATCH", f"/robots/{name}/labels", {"labels": {"site": "lab"}})
        yield lives
        gateway.ask("PATCH", f"/robots/{name}/labels", {"labels": {"site": None}})


def opened(gateway: RealGateway, open_page: OpenPage, name: str = "ada", **options: object) -> Page:
    """Somebody's page of templates."""
    page = open_page(f"{gateway.url}/rollouts/templates", link=gateway.link(name), **options)
    expect(page.locator("[data-template], .nothing").first).to_be_visible()
    return page


def test_one_is_made_changed_and_deleted(gateway: RealGateway, open_page: OpenPage, robot: ScriptedRobot) -> None:
    page = opened(gateway, open_page)
    page.get_by_role("button", name="New template…").click()
    editor = page.locator("[data-card=template]")
    expect(editor.get_by_role("status").last).to_have_text("Give it a name.")
    editor.get_by_label("Name", exact=True).fill("camera-rate")
    editor.get_by_role("button", name="site=lab").click()
    expect(editor.locator("[data-named]")).to_have_attribute("data-named", "1")
    editor.get_by_role("button", name="JSON").click()
    document = editor.get_by_label("The template's document")
    document.fill("{nonsense")
    expect(editor.get_by_role("button", name="Show what would change")).to_be_disabled()
    document.fill(CAMERA.replace("5.0", '"fast"'))
    editor.get_by_role("button", name="Show what would change").click()
    expect(editor.get_by_role("alert")).to_contain_text("rate_hz")
    document.fill(CAMERA)
    editor.get_by_label("Reason").fill("bandwidth")
    editor.get_by_role("button", name="Show what would change").click()
    plan = editor.get_by_label("What would change")
    expect(plan).to_contain_text(f"{robot.name} would change")
    expect(plan.locator("[data-path='/topics/camera~1**/rate_hz'] ins")).to_have_text("5.0")
    save(page, "templates-plan")
    assert gateway.ask("GET", "/templates")["templates"] == []
    editor.get_by_role("button", name="Apply to 1 robot").click()
    card = page.locator("[data-template=camera-rate]")
    expect(card).to_contain_text("site=lab")
    expect(card).to_contain_text("bandwidth")
    wait_until(lambda: robot.document.get("topics", {}).get("camera/**", {}).get("rate_hz") == 5.0)
    save(page, "templates-list")

    card.get_by_role("button", name="Edit camera-rate").click()
    editor.get_by_role("button", name="JSON").click()
    document.fill(CAMERA.replace("5.0", "2.0"))
    editor.get_by_role("button", name="Show what would change").click()
    editor.get_by_role("button", name="Apply to 1 robot").click()
    wait_until(lambda: robot.document["topics"]["camera/**"]["rate_hz"] == 2.0)
    expect(card).to_contain_text("revision 3")  # the label was the first change

    card.get_by_role("button", name="Delete camera-rate").click()
    dialog = page.get_by_role("dialog")
    expect(dialog.locator(".change-remove").first).to_be_visible()
    save(page, "templates-delete")
    dialog.get_by_role("button", name="Delete").click()
    expect(page.locator(".nothing")).to_contain_text("No template yet")
    wait_until(lambda: not robot.document.get("topics"))


def test_its_history_leads_back(gateway: RealGateway, open_page: OpenPage, robot: ScriptedRobot) -> None:
    for bytes_per_s in (9000, 70_000):
        body = {"selector": "site=lab", "document": {"budget": {"bytes_per_s": bytes_per_s}}}
        gateway.ask("PUT", f"/templates/uplink?reason=to+{bytes_per_s}", body)
    page = opened(gateway, open_page)
    page.get_by_role("button", name="History of uplink").click()
    dialog = page.get_by_role("dialog")
    entries = dialog.locator("[data-entry]")
    expect(entries).to_have_count(2)
    expect(entries.first).to_contain_text("to 70000")
    expect(entries.first.get_by_role("button", name="Go back")).to_have_count(0)
    entries.last.locator("summary").click()
    entries.last.get_by_role("button", name="Go back to this…").click()
    expect(entries.last.get_by_label("What would change")).to_contain_text(f"{robot.name} would change")
    save(page, "templates-history")
    wait_until(lambda: robot.document.get("budget") == {"bytes_per_s": 70_000})
    entries.last.get_by_role("button", name="Go back to it for 1 robot").click()
    expect(dialog).to_have_count(0)
    wait_until(lambda: robot.document["budget"] == {"bytes_per_s": 9000})
    expect(page.locator("[data-template=uplink]")).to_contain_text("back to revision")


def test_who_was_overtaken_is_reported(gateway: RealGateway, open_page: OpenPage, robot: ScriptedRobot) -> None:
    gateway.ask("PUT", "/templates/camera-rate", {"selector": "site=lab", "document": {}})
    page = opened(gateway, open_page)
    page.get_by_role("button", name="Edit camera-rate").click()
    gateway.ask(
        "PUT", "/templates/camera-rate", {"selector": "site=lab", "document": {"budget": {"bytes_per_s": 9000}}}
    )
    editor = page.locator("[data-card=template]")
    editor.get_by_label("Priority").fill("7")
    editor.get_by_role("button", name="Show what would change").click()
    expect(editor.get_by_role("alert")).to_contain_text("camera-rate")
    assert gateway.ask("GET", "/templates/camera-rate")["priority"] == 0
    editor.get_by_role("button", name="Cancel").click()
    page.get_by_role("button", name="New template…").click()
    editor.get_by_label("Name", exact=True).fill("camera-rate")
    expect(editor).to_contain_text("There is a template of that name.")


def test_an_operator_reads(gateway: RealGateway, open_page: OpenPage) -> None:
    gateway.ask("PUT", "/templates/camera-rate", {"selector": "site=lab", "document": {}})
    page = opened(gateway, open_page, "bo")
    expect(page.get_by_text("Admins may change templates; bo is an operator.")).to_be_visible()
    for name in ("New template…", "Edit camera-rate", "Delete camera-rate"):
        expect(page.get_by_role("button", name=name)).to_have_count(0)


def test_it_fits_a_phone_and_can_be_read(gateway: RealGateway, open_page: OpenPage) -> None:
    document = {"topics": {"camera/**": {"class": "live", "rate_hz": 5.0}}, "budget": {"bytes_per_s": 250_000}}
    for name, selector in (("a-camera-rate", "site=lab, kind in (arm, cart)"), ("b-all", "")):
        gateway.ask("PUT", f"/templates/{name}?reason=less+bandwidth", {"selector": selector, "document": document})
    page = opened(gateway, open_page, size=PHONE, touch=True)
    page.locator("[data-template=a-camera-rate] summary").click()
    faults = unreadable(page, "list", shot="templates-phone")
    page.get_by_role("button", name="Edit b-all").click()
    page.locator("[data-section=topics]").wait_for()
    assert faults + unreadable(page, "editor", shot="templates-edit-phone") == []
