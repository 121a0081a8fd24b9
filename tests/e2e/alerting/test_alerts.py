"""The Alerts page in a real browser: the timeline, the list, one alert with its plot, and what people do about it."""

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
CLIP_LOOKS_AGAIN_MS = 5_000
ROWS = "[...document.querySelectorAll('[data-alert-row]')].map(row => row.dataset.alertRow).join()"
# How many pixels of the plot have about that hue: red is out of the band, teal within it.
REDS = """() => {
  const canvas = document.querySelector('[data-card=band] canvas')
  const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height)
  let count = 0
  for (let i = 0; i < data.length; i += 4) count += data[i] > 150 && data[i + 1] < 70 && data[i + 2] < 70
  return count
}"""


def world(gateway: FakeGateway) -> dict[str, Any]:
    """Six alerts of three robots: the hot motor is the worst."""
    now_s, alerts = gateway.seconds(), gateway.alerts
    seen = {"state": "acknowledged", "acknowledged_by": "bo", "assignee": "bo", "times": 3}
    alerts.add("sim_2", now_s - 1900, title="Battery", cause="battery", reason="Charge is 14 %.", **seen)
    offline = alerts.add("sim_2", now_s - 9000, until_s=now_s - 7200, severity="error", title="Robot is offline")
    alerts.add("sim_2", now_s - 8980, until_s=now_s - 7200, title="Silent", quiet=True, inhibited_by=offline["id"])
    alerts.add("sim_3", now_s - 900, severity="info", title="A value shakes more than usual", cause="vibration")
    alerts.add("sim_1", now_s - 4000, until_s=now_s - 3500, title="A topic's rate is off", resolved_by="ada")
    return alerts.heat(gateway.robots[0])


def test_what_is_wrong_is_seen_in_time_and_by_urgency(gateway: FakeGateway, open_page: OpenPage) -> None:
    hot = world(gateway)
    page = open_page(gateway.url)
    page.get_by_role("link", name="Alerts 3 open").click()
    expect(page).to_have_title("Alerts · Meta-ROS")
    rows = page.locator("[data-alert-row]")
    expect(rows).to_have_count(3)
    expect(rows.first).to_contain_text("Too hot")
    expect(rows.nth(1)).to_contain_text("acknowledged by bo")
    expect(page.locator("[data-lane]")).to_have_count(3)
    expect(page.locator("[data-bar]")).to_have_count(6)
    bar = page.locator(f"[data-bar='{hot['id']}']")
    expect(bar).to_have_attribute("data-over", "false")
    bar.hover()
    expect(page.locator(".card-lanes .note")).to_contain_text("sim_1 · Too hot")
    save(page, "alerts")
    page.get_by_role("button", name="resolved 3").click()
    expect(rows).to_have_count(3)
    assert "state=resolved" in page.url
    page.get_by_label("Search alerts").fill("offline")
    expect(rows).to_have_count(1)
    page.get_by_label("Search alerts").fill("nothing like it")
    expect(page.locator(".quiet")).to_contain_text("No alert is like that.")
    page.get_by_role("button", name="Show all").click()
    expect(rows).to_have_count(6)
    page.get_by_role("combobox", name="Robot").select_option("sim_3")
    page.get_by_role("button", name="info", exact=True).click()
    expect(rows).to_have_count(1)
    page.reload()
    expect(rows).to_have_count(1)


def test_a_new_alert_and_its_end_are_seen_at_once(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{gateway.url}/alerts")
    expect(page.locator(".all-well h2")).to_have_text("Nothing is wrong")
    expect(page.locator(".nav-count")).to_have_count(0)
    page.wait_for_function("() => performance.getEntriesByType('resource').length > 5")
    for _ in range(600):
        if ("events", "alert.*") in gateway.alerts.asked:
            break
        page.wait_for_timeout(100)
    row = gateway.alerts.add("sim_1", gateway.seconds() - 30, severity="error")
    expect(page.locator("[data-alert-row]")).to_have_count(1)
    expect(page.locator(".nav-error")).to_have_attribute("data-open", "1")
    row |= {"state": "resolved", "resolved": row["opened"]}
    gateway.alerts.tell("sim_1")
    expect(page.locator(".all-well")).to_be_visible()
    expect(page.locator(".nav-count")).to_have_count(0)


def test_keys_lead_through_the_list(gateway: FakeGateway, open_page: OpenPage) -> None:
    hot = world(gateway)
    page = open_page(f"{gateway.url}/alerts")
    expect(page.locator("[data-alert-row]")).to_have_count(3)
    for key in ("j", "j", "k"):
        page.keyboard.press(key)
    focused = "() => document.activeElement.closest('[data-alert-row]')?.dataset.alertRow"
    assert page.evaluate(focused) == hot["id"]
    page.keyboard.press("a")
    expect(page.locator("[data-alert-row]").first).to_contain_text("acknowledged by ada")
    assert (
        gateway.alerts.asked[-1] == ("acknowledge", {"text": ""})
        or ("acknowledge", {"text": ""}) in gateway.alerts.asked
    )
    page.keyboard.press("Enter")
    expect(page.locator("h1")).to_have_text("Too hot")
    page.keyboard.press("Escape")
    expect(page.locator("h1")).to_have_text("Alerts")


def test_one_alert_shows_what_was_expected_and_leads_to_the_moment(gateway: FakeGateway, open_page: OpenPage) -> None:
    hot = world(gateway)
    page = open_page(f"{gateway.url}/alerts/{hot['id']}")
    expect(page.locator(".alert-say")).to_contain_text("a motor overheats above 95 °C")
    expect(page.locator(".card-band")).to_contain_text("96.4\u202f°C, expected 39.1 to 43.2\u202f°C")
    page.wait_for_function(f"() => document.querySelector('[data-card=band] canvas') && ({REDS})() > 200")
    expect(page.locator("[data-findings='3'] li")).to_have_count(3)
    expect(page.locator("[data-findings] li[data-active=false]")).to_contain_text("rises by 0.9 °C/s")
    save(page, "alert")
    page.get_by_role("button", name="1h", exact=True).click()
    page.wait_for_function(f"() => document.querySelector('[data-card=band] canvas') && ({REDS})() > 50")
    page.get_by_role("link", name="See sim_1 at").click()
    expect(page.locator("[data-mode=past]")).to_be_visible()
    shown_ms = float(page.locator(".timebar").get_attribute("data-t") or 0)
    assert shown_ms / 1000 == pytest.approx(gateway.seconds() - 240, abs=60)


def test_without_a_remembered_band_the_alert_s_own_bounds_stand(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.alerts.remembers = False
    hot = gateway.alerts.heat(gateway.robots[0])
    page = open_page(f"{gateway.url}/alerts/{hot['id']}")
    page.wait_for_function(f"() => document.querySelector('[data-card=band] canvas') && ({REDS})() > 30")
    gateway.history.empty = True
    page.reload()
    expect(page.locator(".band-legend")).to_have_text("Nothing of it is stored around that time.")


def test_people_see_to_it(gateway: FakeGateway, open_page: OpenPage) -> None:
    hot = gateway.alerts.heat(gateway.robots[0])
    page = open_page(f"{gateway.url}/alerts/{hot['id']}")
    page.get_by_role("button", name="Acknowledge").click()
    expect(page.locator("[data-alert-state=acknowledged]")).to_have_text("acknowledged by ada")
    page.get_by_role("button", name="Unacknowledge").click()
    expect(page.locator("[data-alert-state=open]")).to_be_visible()
    page.get_by_role("button", name="Assign…").click()
    page.get_by_role("dialog").get_by_role("button", name="I do").click()
    expect(page.locator(".alert-head")).to_contain_text("→ ada")
    page.get_by_label("Comment").fill(f'a cable <img src=x onerror="{PROBE}">')
    page.get_by_role("button", name="Comment").click()
    expect(page.locator("[data-remark=comment]")).to_contain_text("ada wrote")
    expect(page.get_by_label("Comment")).to_have_value("")
    page.get_by_role("button", name="This is normal…").click()
    page.get_by_label("Why it is normal").fill("a hot day")
    page.get_by_role("button", name="It is normal").click()
    expect(page.locator("[data-taught='1']")).to_contain_text("may be 96.4")
    gateway.alerts.refuses = "it is resolved already"
    page.get_by_role("button", name="Resolve…").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_label("What was it").fill("the cable")
    dialog.get_by_role("button", name="Resolve").click()
    expect(dialog.get_by_role("alert")).to_have_text("it is resolved already")
    gateway.alerts.refuses = ""
    dialog.get_by_role("button", name="Resolve").click()
    expect(page.locator("[data-alert-state=resolved]")).to_have_text("resolved by ada")
    expect(page.get_by_role("button", name="Acknowledge")).to_have_count(0)
    assert page.evaluate("window.__ran") is None


def test_the_clip_is_asked_for_and_downloaded(gateway: FakeGateway, open_page: OpenPage) -> None:
    hot = gateway.alerts.heat(gateway.robots[0])
    page = open_page(f"{gateway.url}/alerts/{hot['id']}", clock=True)
    page.get_by_role("button", name="Ask for the clip").click()
    expect(page.locator("[data-clip-state=requested]")).to_contain_text("waits for the robot")
    (clip,) = gateway.recordings.rows
    clip |= {"state": "transferring", "size_bytes": 4_000_000, "received_bytes": 1_000_000}
    page.clock.fast_forward(CLIP_LOOKS_AGAIN_MS)
    expect(page.get_by_role("progressbar")).to_have_attribute("aria-valuenow", "25")
    clip |= {"state": "stored", "received_bytes": 4_000_000}
    page.clock.fast_forward(CLIP_LOOKS_AGAIN_MS)
    with page.expect_download() as download:
        page.get_by_role("link", name="Download MCAP").click()
    assert download.value.suggested_filename.startswith("sim_1-")


def test_silences_are_made_seen_and_ended(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.account = account(Role.ADMIN)
    hot = gateway.alerts.heat(gateway.robots[0])
    page = open_page(f"{gateway.url}/alerts/{hot['id']}")
    page.get_by_role("button", name="Silence for 8 h").click()
    expect(page.locator(".alert-note")).to_contain_text("Nobody is notified of it")
    assert gateway.alerts.silences[0]["causes"] == ["heat"]
    page.get_by_role("link", name="silence", exact=True).click()
    row = page.locator("[data-silence]")
    expect(row).to_contain_text("sim_1 · heat")
    expect(row).to_contain_text("in 8\u202fh")
    row.get_by_role("button", name="End…").click()
    page.get_by_role("dialog").get_by_role("button", name="End it").click()
    expect(page.locator(".nothing")).to_contain_text("Nothing is silenced.")
    page.get_by_role("button", name="Silence…").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_label("Robots").fill("bench_* sim_2")
    dialog.get_by_role("button", name="warnings and below").click()
    dialog.get_by_role("button", name="other").click()
    dialog.get_by_label("Hours").fill("x")
    expect(dialog.get_by_role("button", name="Silence for")).to_be_disabled()
    dialog.get_by_label("Hours").fill("2.5")
    dialog.get_by_label("Why").fill("rewiring")
    dialog.get_by_role("button", name="Silence for 2.5\u202fh").click()
    expect(row).to_contain_text("bench_*, sim_2 · every cause")
    sent = dict(gateway.alerts.asked)["silences"]
    assert {**sent, "for_s": 9000} == {
        "robots": ["bench_*", "sim_2"], "causes": [], "up_to": "warning", "for_s": 9000, "reason": "rewiring"
    }  # fmt: skip


def test_an_admin_changes_the_checks(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{gateway.url}/alerts/checks")
    row = page.locator("[data-check=motor_hot]")
    expect(row).to_contain_text("above 80\u202f°C for 5\u202fs")
    expect(page.get_by_role("button", name="Edit")).to_have_count(0)
    gateway.account = account(Role.ADMIN)
    page.reload()
    row.get_by_role("button", name="Edit Motor is hot").click()
    dialog = page.get_by_role("dialog")
    expect(dialog.get_by_role("button", name="Save")).to_be_disabled()
    dialog.get_by_label("Above").fill("hot")
    expect(dialog.get_by_role("alert")).to_have_text("is no number that fits")
    dialog.get_by_label("Above").fill("85")
    dialog.get_by_role("button", name="error").click()
    dialog.get_by_role("button", name="Save").click()
    expect(row).to_contain_text("above 85\u202f°C")
    assert gateway.alerts.asked[-1] == ("check motor_hot", {"high": 85, "severity": "error"})
    row.get_by_role("button", name="Edit Motor is hot").click()
    dialog.get_by_role("button", name="As it comes").click()
    expect(row).to_contain_text("above 80\u202f°C")


def test_learning_says_how_far_it_is(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.alerts.heat(gateway.robots[0])
    page = open_page(f"{gateway.url}/alerts/learning")
    expect(page.locator("[data-learning=sim_1]")).to_contain_text("learning 1 of 12 series, 62 of 750 samples")
    expect(page.locator("[data-series-row]").first).to_contain_text("Motor temperature")
    expect(page.locator("[data-series-row]").first.locator("[data-strange=very]")).to_be_visible()
    page.get_by_label("Search series").fill("cpu")
    expect(page.locator("[data-series-row]")).to_have_count(1)
    expect(page.get_by_role("progressbar")).to_have_attribute("aria-valuenow", "8")
    page.get_by_role("combobox", name="Robot").select_option("sim_2")
    expect(page.locator("[data-learning=sim_2]")).to_be_visible()


def test_a_viewer_looks_and_is_reported_who_may_do_something(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.account = account(Role.VIEWER)
    hot = gateway.alerts.heat(gateway.robots[0])
    page = open_page(f"{gateway.url}/alerts/{hot['id']}")
    expect(page.get_by_text("Operators may handle alerts")).to_be_visible()
    expect(page.get_by_label("Comment")).to_have_count(0)
    page.goto(f"{gateway.url}/alerts/01NOSUCHALERT")
    expect(page.locator(".empty")).to_contain_text("there is no such alert")


def test_the_pages_fit_a_phone_and_can_be_read(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.account = account(Role.ADMIN)
    hot = world(gateway)
    hot["reason"] = "Motor temperature " + "very_" * 60
    page = open_page("about:blank", size=PHONE, touch=True)
    faults = []
    for path, part in (
        ("", "[data-alert-row]"),
        (f"/{hot['id']}", "[data-alert]"),
        ("/silences", ".nothing"),
        ("/checks", "[data-check]"),
        ("/learning", "[data-learning]"),
    ):
        page.goto(f"{gateway.url}/alerts{path}")
        expect(page.locator(part).first).to_be_visible()
        faults += unreadable(page, path)
    assert faults == []
