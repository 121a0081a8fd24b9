"""The Rules page in a real browser: the list, the editor with what is refused, dry runs, schedules, hooks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from gateway.domain.principal import Role
from tests.e2e.conftest import PHONE, save
from tests.e2e.fake.gateway import FakeGateway, account
from tests.e2e.fleet.test_fleet_page import PROBE
from tests.e2e.readable import unreadable

pytestmark = [pytest.mark.browser, pytest.mark.xdist_group("browser")]

OpenPage = Callable[..., Page]
SECRET = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"
# What is selected in the focused text.
SELECTED = (
    "document.activeElement.value.slice(document.activeElement.selectionStart, document.activeElement.selectionEnd)"
)
LOOKS_AGAIN_MS = 5000  # the page of a rule asks for it so often


@pytest.fixture
def admin(gateway: FakeGateway) -> FakeGateway:
    """An admin looks at four rules."""
    gateway.account = account(Role.ADMIN)
    gateway.rules.world()
    return gateway


def last(gateway: FakeGateway) -> tuple[str, Any]:
    """What was asked last."""
    return gateway.rules.asked[-1]


def test_what_rules_do_is_said_in_words(admin: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(admin.url)
    page.get_by_role("link", name="Rules").click()
    expect(page).to_have_title("Rules · Meta-ROS")
    rows = page.locator("[data-rule]")
    expect(rows).to_have_count(4)
    expect(rows.first).to_contain_text("there is no function page_on_call")
    battery = page.locator("[data-rule=battery_low]")
    expect(battery).to_contain_text("battery_state.percentage of sim_* below 0.2")
    expect(battery).to_contain_text("for 30s · then quiet for 10m")
    expect(battery).to_contain_text("calls dock_when_low:live")
    expect(page.locator("[data-rule=every_night]")).to_contain_text("next in 62")
    save(page, "rules")
    battery.get_by_role("switch").click()
    expect(battery.get_by_role("switch")).to_have_attribute("aria-checked", "false")
    assert last(admin) == ("disable battery_low", None)
    page.get_by_label("Search rules").fill("bumper")
    expect(rows).to_have_count(1)


def test_no_rule_yet_says_what_to_do(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.account = account(Role.ADMIN)
    page = open_page(f"{gateway.url}/rules")
    page.get_by_role("link", name="Make the first rule").click()
    expect(page.locator("h1")).to_have_text("New rule")


def test_a_rule_is_made_with_the_form(admin: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{admin.url}/rules?show=new")
    make = page.get_by_role("button", name="Make it")
    expect(make).to_be_disabled()
    page.get_by_label("Name").fill("Too Hot")
    expect(page.locator("[data-faults='1']")).to_contain_text("name")
    page.get_by_label("Name").fill("too_hot")
    expect(page.locator("[data-faults='0']")).to_be_visible()
    page.get_by_role("button", name="number").click()
    page.get_by_label("Number").fill("motor.temperature")
    page.get_by_label("Below").fill("")
    expect(page.locator("[data-faults='1']")).to_contain_text("above, or below, or both")
    page.get_by_label("Above").fill("80.0")
    page.get_by_label("Holds for").fill("10s")
    page.get_by_label("Add a target").select_option("webhook")
    page.get_by_label("URL").fill("ftp://x")
    expect(page.locator(".rule-target").get_by_role("alert")).to_contain_text("an http(s) URL")
    page.locator(".rule-faults button").click()
    assert "ftp://x" in page.evaluate(SELECTED)
    page.get_by_label("URL").fill("https://hooks.example/T1")
    page.get_by_role("button", name="What it is given…").click()
    page.get_by_label("It is given").select_option("transformer")
    expect(page.locator("[data-faults='0']")).to_be_visible()
    make.click()
    expect(page.locator("h1")).to_have_text("too_hot")
    assert page.url.endswith("/rules/too_hot")
    said, document = last(admin)
    assert said == 'put too_hot "0"'
    assert document["metric"] == {"series": "motor.temperature", "robots": ["*"], "above": 80.0}
    assert document["when"] == {"for": "10s"}
    assert document["targets"][0]["transformer"]["paths"] == {"robot": "$.detail.robot"}


def test_form_and_json_are_one_document(admin: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{admin.url}/rules/battery_low")
    text = page.get_by_label("The rule as JSON")
    save(page, "rule")
    page.get_by_label("Below").fill("0.15")
    assert '"below": 0.15' in text.input_value()
    text.fill(text.input_value().replace('"cooldown": "10m"', '"cooldown": "1h"'))
    expect(page.get_by_label("Then not for")).to_have_value("1h")
    text.fill("{")
    expect(page.locator("[data-faults=json]")).to_contain_text("No JSON")
    expect(page.get_by_role("button", name="Save")).to_be_disabled()
    page.get_by_role("button", name="Drop changes").click()
    expect(page.get_by_label("Then not for")).to_have_value("10m")
    page.get_by_role("button", name="Remove slack").click()
    expect(page.locator("[data-target]")).to_have_count(1)
    page.get_by_role("button", name="Save").click()
    expect(page.locator(".rule-foot")).to_contain_text("Saved.")
    said, document = last(admin)
    assert said == 'put battery_low "3"'
    assert [target["id"] for target in document["targets"]] == ["dock"]


def test_who_comes_second_is_reported(admin: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{admin.url}/rules/battery_low", clock=True)
    page.get_by_label("Below").fill("0.1")
    row = admin.rules.rows["battery_low"]
    row |= {"revision": 4, "metric": {"series": "cpu", "robots": ["*"], "above": 90}}
    page.clock.fast_forward(LOOKS_AGAIN_MS)
    expect(page.locator(".moved")).to_contain_text("revision 4")
    page.get_by_role("button", name="Save").click()
    expect(page.locator(".rule-foot").get_by_role("alert")).to_have_text("it was changed meanwhile")
    page.get_by_role("button", name="Drop mine, show theirs").click()
    expect(page.get_by_label("Above")).to_have_value("90")


def test_a_dry_run_shows_when_it_would_have_fired(admin: FakeGateway, open_page: OpenPage) -> None:
    admin.rules.firings[0]["targets"][0]["payload"] = {"text": f'<img src=x onerror="{PROBE}">'}
    page = open_page(f"{admin.url}/rules/battery_low")
    page.get_by_label("Below").fill("0.5")
    page.get_by_role("button", name="Dry run…").click()
    page.get_by_role("button", name="6 hours").click()
    page.locator(".rule-run").click()
    expect(page.locator("[data-dry='14']")).to_contain_text("would have fired 14 times")
    said, body = last(admin)
    assert (said, body["from"], body["rule"]["metric"]["below"]) == ("dry-run", "-6h", 0.5)  # the draft, not the stored
    expect(page.locator("[data-lane]")).to_have_count(3)
    expect(page.locator(".dry-mark")).to_have_count(14)
    save(page, "dry-run")
    page.locator("[data-lane=sim_1] .dry-mark").first.click()
    expect(page.locator("[data-firing]").first.locator(".fn-log")).to_contain_text("onerror")
    assert page.evaluate("window.__ran") is None
    admin.rules.firings = []
    page.locator(".rule-run").click()
    expect(page.locator("[data-dry='0']")).to_contain_text("would not have fired")


def test_a_schedule_shows_its_next_times(admin: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{admin.url}/rules?show=schedules")
    row = page.locator("[data-schedule=every_night]")
    expect(row).to_contain_text("cron(0 3 * * ? *)")
    row.get_by_role("link").click()
    times = page.locator("[data-times='5'] li")
    expect(times).to_have_count(5)
    expect(times.first).to_contain_text("03:00")
    page.get_by_label("Schedule", exact=True).fill("cron(0 25 * * ? *)")
    expect(page.locator(".next-times").get_by_role("alert")).to_contain_text("25")
    expect(page.locator("[data-faults='1']")).to_contain_text("schedule")


def test_secrets_are_shown_once(admin: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{admin.url}/rules?show=hooks")
    page.get_by_role("button", name="New hook…").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_label("Name").fill("gate")
    dialog.get_by_role("button", name="the secret itself").click()
    dialog.get_by_role("button", name="Make it").click()
    expect(page.locator("[data-copy=secret]")).to_contain_text(SECRET)
    expect(page.get_by_role("dialog")).to_contain_text("/api/v1/hooks/gate")
    page.get_by_role("button", name="I have it").click()
    expect(page.locator("[data-hook=gate]")).to_contain_text("the secret itself")
    page.get_by_role("button", name="Delete gate").click()
    page.get_by_role("dialog").get_by_role("button", name="Delete it").click()
    expect(page.locator("[data-hook]")).to_have_count(1)
    page.goto(f"{admin.url}/rules/battery_low")
    page.get_by_role("button", name="New secret…").click()
    page.get_by_role("dialog").get_by_role("button", name="Make it").click()
    expect(page.locator("[data-copy=secret]")).to_contain_text(SECRET)
    assert last(admin) == ("secret battery_low/slack", None)


def test_a_viewer_reads_and_tries(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.account = account(Role.VIEWER)
    gateway.rules.world()
    page = open_page(f"{gateway.url}/rules")
    expect(page.locator("[data-rule=battery_low]").get_by_role("switch")).to_be_disabled()
    expect(page.get_by_text("Admins may change rules")).to_be_visible()
    page.get_by_role("link", name="battery_low").click()
    expect(page.locator(".rule-read")).to_contain_text('"below": 0.2')
    page.get_by_role("button", name="History").click()
    expect(page.locator("[data-revision='3']")).to_contain_text("changed by ada")
    page.get_by_role("button", name="Dry run").click()
    page.locator(".rule-run").click()
    expect(page.locator("[data-dry='14']")).to_be_visible()


def test_a_rule_is_deleted(admin: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{admin.url}/rules/bumped")
    page.get_by_role("button", name="Delete…").click()
    page.get_by_role("dialog").get_by_role("button", name="Delete it").click()
    expect(page.locator("[data-rule]")).to_have_count(3)
    page.goto(f"{admin.url}/rules/bumped")
    expect(page.locator(".empty")).to_contain_text("there is no such rule")


def test_the_pages_fit_a_phone_and_can_be_read(admin: FakeGateway, open_page: OpenPage) -> None:
    admin.rules.rows["bumped"]["description"] = "Keeps " + "very_" * 60
    page = open_page("about:blank", size=PHONE, touch=True)
    shows = ("", "?show=schedules", "?show=hooks", "?show=new")
    faults = []
    for path in (*shows, "/battery_low", "/battery_low?tab=try", "/every_night", "/errors?tab=history"):
        page.goto(f"{admin.url}/rules{path}")
        expect(page.locator("h1").first).to_be_visible()
        expect(page.locator(".quiet")).to_have_count(0)
        faults += unreadable(page, path)
    assert faults == []
