"""The Functions page in a real browser: the list, one function and its parts, dead letters, where functions run."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable

import pytest
from playwright.sync_api import Page, expect

from gateway.domain.principal import Role
from tests.e2e.conftest import PHONE, save
from tests.e2e.fake.gateway import FakeGateway, account
from tests.e2e.fleet.test_fleet_page import PROBE
from tests.e2e.readable import unreadable

pytestmark = [pytest.mark.browser, pytest.mark.xdist_group("browser")]

OpenPage = Callable[..., Page]
TABS = ("", "?tab=invocations", "?tab=log", "?tab=test", "?tab=code", "?tab=dead")


@pytest.fixture
def admin(gateway: FakeGateway) -> FakeGateway:
    """An admin looks at four functions."""
    gateway.account = account(Role.ADMIN)
    gateway.functions.world()
    return gateway


def zip_of(source: str) -> bytes:
    """A function's code as it is deployed."""
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w") as file:
        file.writestr("handler.py", source)
    return held.getvalue()


def test_who_is_called_how_often_and_how_well_is_seen_at_once(admin: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(admin.url)
    page.get_by_role("link", name="Functions").click()
    expect(page).to_have_title("Functions · Meta-ROS")
    rows = page.locator("[data-function]")
    expect(rows).to_have_count(4)
    expect(rows.first).to_contain_text("page_on_call")  # it fails
    expect(rows.first).to_contain_text("7 dead letters")
    expect(rows.nth(1)).to_contain_text("canary runs")
    expect(page.locator("[data-function=image_to_s3]")).to_contain_text("/camera/image of sim_*")
    expect(page.locator("[data-runtime=L3]")).to_contain_text("3 of 8 workers")
    assert page.locator("[data-function=dock_when_low] .trend rect").count() >= 28
    save(page, "functions-list")
    page.get_by_label("Search functions").fill("s3")
    expect(rows).to_have_count(1)
    page.get_by_label("Search functions").fill("nothing like it")
    page.get_by_role("button", name="Show all").click()
    expect(rows).to_have_count(4)
    page.keyboard.press("Escape")
    page.get_by_role("link", name="dock_when_low").focus()
    page.keyboard.press("Enter")
    expect(page.locator("h1")).to_have_text("dock_when_low")


def test_no_function_yet_says_what_to_do(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{gateway.url}/functions")
    expect(page.locator(".fn-first")).to_contain_text("metaros function deploy")
    expect(page.locator(".fn-first")).to_contain_text("ask an admin")
    expect(page.locator(".may-not")).to_contain_text("Admins may deploy functions")


def test_one_function_with_its_canary(admin: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{admin.url}/functions/dock_when_low")
    expect(page.locator("[data-figure=Calls]")).to_contain_text("4,674")
    expect(page.locator("[data-canary=running]")).to_contain_text("3 of 212 calls failed so far")
    expect(page.locator("[data-trigger=rule] a")).to_have_attribute("href", "/rules/battery_low")
    page.locator(".chart").focus()
    page.keyboard.press("ArrowLeft")
    expect(page.locator(".chart-said")).to_contain_text("calls")
    save(page, "functions")
    page.get_by_role("button", name="Stop canary…").click()
    page.get_by_role("dialog").get_by_role("button", name="Stop it").click()
    expect(page.locator("[data-canary=cancelled]")).to_contain_text("Version 1 gets every call again.")
    page.get_by_role("button", name="Canary…", exact=True).click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_label("Back above").fill("2")
    dialog.get_by_label("On after").fill("10")
    dialog.get_by_role("button", name="Start").click()
    expect(page.locator("[data-canary=running]")).to_contain_text("Version 2 gets 10")
    assert admin.functions.asked[-1] == (
        "canary dock_when_low:live",
        {"version": "2", "weight": 0.1, "error_rate": 0.02, "least_invocations": 20, "for_s": 600, "step": 0},
    )


def test_settings_versions_and_aliases_are_changed(admin: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{admin.url}/functions/dock_when_low")
    page.get_by_role("region", name="Settings").get_by_role("button", name="Edit…").click()
    dialog = page.get_by_role("dialog")
    expect(dialog.get_by_role("button", name="Save")).to_be_disabled()
    dialog.get_by_label("Timeout").fill("soon")
    expect(dialog.get_by_role("alert")).to_have_text("is no whole number")
    dialog.get_by_label("Timeout").fill("30")
    dialog.get_by_label("Environment").fill("LEAST=0.3\nnot one")
    expect(dialog.get_by_role("alert")).to_contain_text("not one is no NAME=value")
    dialog.get_by_label("Environment").fill("LEAST=0.3")
    dialog.get_by_role("button", name="Save").click()
    expect(page.locator(".fn-environment")).to_contain_text("0.3")
    assert admin.functions.asked[-1] == ("set dock_when_low", {"timeout_s": 30, "environment": {"LEAST": "0.3"}})
    page.get_by_role("button", name="Publish…").click()
    dialog.get_by_label("What is new").fill("asks twice")
    dialog.get_by_role("button", name="Publish").click()
    expect(page.locator("[data-version='3']")).to_contain_text("asks twice")
    page.get_by_role("button", name="New alias…").click()
    dialog.get_by_label("Name").fill("test")
    dialog.get_by_role("button", name="Save").click()
    expect(page.locator("[data-alias=test]")).to_contain_text("version 3")


def test_calls_are_filtered_and_read(admin: FakeGateway, open_page: OpenPage) -> None:
    admin.functions.calls[0]["error_message"] = f'<img src=x onerror="{PROBE}">'
    page = open_page(f"{admin.url}/functions/dock_when_low?tab=invocations")
    rows = page.locator("[data-call]")
    expect(rows).to_have_count(24)
    page.get_by_role("button", name="timeout").click()
    expect(page.locator("[data-call][data-status=ok]")).to_have_count(0)
    expect(rows.first).to_contain_text("Task timed out after 3.00 seconds")
    page.get_by_role("button", name="error", exact=True).click()
    rows.first.locator("summary").click()
    expect(rows.first.locator(".fn-log")).to_contain_text("Traceback")
    page.get_by_role("button", name="throttled").click()
    expect(page.locator(".nothing")).to_have_text("No call was like that.")
    assert page.evaluate("window.__ran") is None


def test_the_log_follows_pauses_and_is_cleared(admin: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{admin.url}/functions/dock_when_low?tab=log")
    log = page.locator(".fn-tail")
    expect(log).to_have_attribute("data-lines", "4")
    expect(page.locator("[data-live=true]")).to_be_visible()
    admin.functions.say("KeyError: 'value'")
    expect(log.locator(".tail-error")).to_contain_text("KeyError")
    page.get_by_role("button", name="Pause").click()
    admin.functions.say("while nobody looks")
    expect(page.get_by_role("button", name="Follow (1 new)")).to_be_visible()
    expect(log).to_have_attribute("data-lines", "5")
    page.get_by_role("button", name="Follow").click()
    expect(log).to_have_attribute("data-lines", "6")
    page.get_by_label("Search the log").fill("docking")
    expect(log).to_have_attribute("data-lines", "1")
    page.get_by_label("Search the log").fill("")
    page.get_by_role("button", name="Clear").click()
    expect(log).to_have_attribute("data-lines", "0")
    admin.functions.say("after that")
    expect(log).to_have_attribute("data-lines", "1")


def test_a_test_call_shows_what_came_of_it(admin: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{admin.url}/functions/dock_when_low?tab=test")
    event = page.get_by_label("Event as JSON")
    page.get_by_label("Example").select_option("battery")
    assert "battery_state.percentage" in event.input_value()
    event.fill('{"n": 1.0')
    expect(page.get_by_role("alert")).to_contain_text("No JSON")
    expect(page.get_by_role("button", name="Call it")).to_be_disabled()
    event.fill('{"n": 1.0}')
    page.get_by_label("Version").select_option("live")
    event.press("Control+Enter")
    expect(page.locator("[data-answer=ok]")).to_be_visible()
    expect(page.locator(".fn-out")).to_contain_text('"docked": true')
    expect(page.locator(".fn-answer")).to_contain_text("cold start 51")
    assert admin.functions.asked[-1] == ("invoke dock_when_low:live request", '{"n": 1.0}')
    admin.functions.answer = {"status": "error", "payload": {"errorMessage": "'value'"}, "error_type": "KeyError"}
    page.get_by_role("button", name="Call it").click()
    expect(page.locator(".fn-out[data-failed=true]")).to_contain_text("errorMessage")
    page.get_by_role("button", name="As an event").click()
    expect(page.locator(".fn-answer")).to_contain_text("r-9")
    admin.functions.refuses = "it has 4 calls at a time already"
    page.get_by_role("button", name="Call it").click()
    expect(page.locator(".fn-answer").get_by_role("alert")).to_have_text("it has 4 calls at a time already")


def test_the_code_is_shown(admin: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{admin.url}/functions/dock_when_low?tab=code")
    expect(page.locator("[data-file='dock.py'] .code-word").first).to_have_text("import")
    page.get_by_role("button", name="lib/maps.json").click()
    expect(page.locator("[data-file='lib/maps.json']")).to_contain_text('"map": "hall"')
    assert "file=lib" in page.url


def test_a_zip_is_deployed_as_a_new_function(admin: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{admin.url}/functions")
    page.get_by_role("button", name="Deploy…").click()
    dialog = page.get_by_role("dialog")
    expect(dialog.get_by_role("button", name="Deploy")).to_be_disabled()
    code = zip_of("def handler(event, context):\n    return 1\n")
    chosen = {"name": "greet me.zip", "mimeType": "application/zip", "buffer": code}
    dialog.get_by_label("Zip file").set_input_files(files=[chosen])  # type: ignore[list-item]
    expect(dialog.get_by_label("Name")).to_have_value("greet-me")
    dialog.get_by_label("Name").fill("greet")
    dialog.get_by_label("Publish a version").check()
    dialog.get_by_label("Alias").fill("live")
    admin.functions.refuses = "handler.py: it has no function handler"
    dialog.get_by_role("button", name="Deploy").click()
    expect(dialog.get_by_role("alert")).to_contain_text("it has no function handler")
    admin.functions.refuses = ""
    dialog.get_by_role("button", name="Deploy").click()
    expect(page.locator("h1")).to_have_text("greet")
    assert admin.functions.asked[-1] == (
        "upload greet",
        {"handler": "handler.handler", "publish": True, "alias": "live"},
    )
    assert admin.functions.rows["greet"]["code_bytes"] == len(code)


def test_a_function_is_deleted(admin: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{admin.url}/functions/try_me")
    page.get_by_role("button", name="Delete…").click()
    page.get_by_role("dialog").get_by_role("button", name="Delete it").click()
    expect(page.locator("[data-function]")).to_have_count(3)
    page.goto(f"{admin.url}/functions/try_me")
    expect(page.locator(".empty")).to_contain_text("there is no such function")


def test_dead_letters_are_delivered_again_and_dropped(admin: FakeGateway, open_page: OpenPage) -> None:
    admin.functions.die("battery_low/slack", "01HOOK", ago_s=30, kind="webhook")
    page = open_page(f"{admin.url}/functions/page_on_call?tab=dead")
    rows = page.locator("[data-dead]")
    expect(rows).to_have_count(7)
    rows.first.locator(".audit-what").click()
    expect(rows.first.locator(".fn-log")).to_contain_text('"robot": "sim_2"')
    rows.nth(1).get_by_role("checkbox").check()
    rows.nth(2).get_by_role("checkbox").check()
    page.get_by_role("button", name="Drop 2…").click()
    page.get_by_role("dialog").get_by_role("button", name="Drop").click()
    expect(page.get_by_text("2 dead letters dropped.")).to_be_visible()
    expect(rows).to_have_count(5)
    page.get_by_role("button", name="Redrive all…").click()
    expect(page.get_by_role("dialog")).to_contain_text("Deliver 5 dead letters again?")
    page.get_by_role("dialog").get_by_role("button", name="Deliver again").click()
    expect(page.locator(".all-well h2")).to_have_text("Nothing was given up on")
    said = dict(admin.functions.asked)["redrive"]
    assert (said["kind"], said["target"]) == ("function", "page_on_call")
    page.goto(f"{admin.url}/functions?show=dead-letters")
    expect(rows).to_have_count(1)
    expect(rows).to_contain_text("battery_low/slack")


def test_why_the_sandbox_is_no_stronger_is_said(admin: FakeGateway, open_page: OpenPage) -> None:
    reasons = {"L3": "no user namespaces: kernel.unprivileged_userns_clone is 0", "L2": "ok", "L1": "ok", "L0": "ok"}
    admin.functions.runtime |= {"level": "L2", "reasons": reasons}
    page = open_page(f"{admin.url}/functions?show=runtime")
    expect(page.locator("[data-level=L3] .level-why")).to_contain_text("unprivileged_userns_clone")
    expect(page.locator("[data-here=true]")).to_have_attribute("data-level", "L2")
    expect(page.locator("[data-pool=page_on_call]")).to_contain_text("No module named 'requests'")


def test_roles_see_what_they_may_do(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.functions.world()
    page = open_page(f"{gateway.url}/functions/dock_when_low")  # an operator
    expect(page.get_by_role("button", name="Deploy…")).to_have_count(0)
    expect(page.get_by_role("button", name="Stop canary…")).to_have_count(0)
    expect(page.locator(".fn-environment")).to_contain_text("•••")
    page.get_by_role("button", name="Test").click()
    expect(page.get_by_role("button", name="Call it")).to_be_visible()
    gateway.account = account(Role.VIEWER)
    page.goto(f"{gateway.url}/functions/page_on_call?tab=test")
    expect(page.get_by_text("Operators may call functions")).to_be_visible()
    page.get_by_role("button", name="Dead letters").click()
    expect(page.get_by_text("Operators may redrive and drop dead letters")).to_be_visible()


def test_the_pages_fit_a_phone_and_can_be_read(admin: FakeGateway, open_page: OpenPage) -> None:
    admin.functions.rows["try_me"]["description"] = "Tries " + "very_" * 60
    paths = ["/functions", "/functions?show=dead-letters", "/functions?show=runtime"]
    page = open_page("about:blank", size=PHONE, touch=True)
    faults = []
    for path in [*paths, *(f"/functions/dock_when_low{tab}" for tab in TABS)]:
        page.goto(f"{admin.url}{path}")
        expect(page.locator("h1").first).to_be_visible()
        expect(page.locator(".quiet")).to_have_count(0)
        faults += unreadable(page, path)
    assert faults == []
