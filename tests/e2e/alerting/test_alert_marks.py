"""Alerts outside their own page: in the bar, on the fleet's table, on a robot's page, its plots and its time bar."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.conftest import PHONE, save
from tests.e2e.fake.gateway import FakeGateway
from tests.e2e.fleet.test_fleet_page import NAMES
from tests.e2e.readable import unreadable

pytestmark = [pytest.mark.browser, pytest.mark.xdist_group("browser")]

OpenPage = Callable[..., Page]
PLOT = "[data-topic='motor_temperature.temperature'] .plot"


def test_the_fleet_says_who_has_alerts(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(gateway.url)
    page.wait_for_function(f"{NAMES}.join() === 'sim_2,sim_1,sim_3'")
    expect(page.locator("tr[data-robot=sim_3] [data-label=Battery]")).to_contain_text("%")  # all values are there
    width_px = page.locator("tr[data-robot=sim_3] [data-label=Alerts]").evaluate("cell => cell.offsetWidth")
    gateway.alerts.heat(gateway.robots[2])
    gateway.alerts.add("sim_3", gateway.seconds() - 60)
    badge = page.locator("tr[data-robot=sim_3] .alert-badge")
    expect(badge).to_have_text("2 open, the worst: error")
    page.wait_for_function(f"{NAMES}[0] !== 'sim_1'")
    expect(page.locator("tr[data-robot=sim_3]")).to_contain_text("error alert")
    expect(page.locator(".nav-alerts")).to_have_text("Alerts2 open")
    after_px = page.locator("tr[data-robot=sim_3] [data-label=Alerts]").evaluate("cell => cell.offsetWidth")
    assert after_px == pytest.approx(width_px, abs=12), "a badge has its place before it comes"
    badge.click()
    expect(page.locator("h1")).to_have_text("Alerts")
    assert page.url.endswith("/alerts?robot=sim_3")
    expect(page.locator("[data-alert-row]")).to_have_count(2)


@pytest.mark.usefixtures("quiet")
def test_a_robot_s_page_shows_its_open_alerts_and_marks_them_in_time(gateway: FakeGateway, open_page: OpenPage) -> None:
    hot = gateway.alerts.heat(gateway.robots[0])
    now_s = gateway.seconds()
    gateway.alerts.add("sim_1", now_s - 2000, until_s=now_s - 1900, title="A topic's rate is off")
    gateway.alerts.add("sim_2", now_s - 60, title="Battery")
    page = open_page(f"{gateway.url}/robots/sim_1")
    strip = page.locator(".alert-strip")
    expect(strip).to_have_attribute("data-open-alerts", "1")
    expect(strip).to_contain_text("Too hot")
    expect(page.locator("[data-bar-marks]")).to_have_attribute("data-bar-marks", "2")
    page.locator(PLOT).scroll_into_view_if_needed()
    expect(page.locator(PLOT)).to_have_attribute("data-alerts", "2")
    save(page, "alert-marks")
    box = page.locator(".bar-mark.severity-error").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 1, box["y"] + 12)
    expect(page.locator(".bar-said")).to_have_text("Too hot")
    page.goto(gateway.url + hot["path"])
    expect(page.locator("[data-mode=past]")).to_be_visible()
    page.locator(PLOT).scroll_into_view_if_needed()
    expect(page.locator(PLOT)).to_have_attribute("data-alerts", "2")
    strip.get_by_role("link", name="Too hot").click()
    expect(page.locator("h1")).to_have_text("Too hot")


@pytest.mark.usefixtures("quiet")
def test_an_alert_comes_to_an_open_page_and_goes(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{gateway.url}/robots/sim_1")
    expect(page.locator("[data-card=plot]").first).to_be_visible()
    assert page.locator(".alert-strip").count() == 0
    row = gateway.alerts.heat(gateway.robots[0])
    expect(page.locator(".alert-strip")).to_contain_text("Too hot")
    row |= {"state": "resolved", "resolved": row["opened"]}
    gateway.alerts.tell("sim_1")
    expect(page.locator(".alert-strip")).to_have_count(0)
    expect(page.locator("[data-bar-marks='1']")).to_be_attached()  # the time bar remembers it
    page.get_by_role("link", name="Fleet").first.click()
    page.locator("tr[data-robot=sim_2] .robot-link").click()
    expect(page.locator("[data-card=plot]").first).to_be_visible()
    assert page.locator("[data-bar-marks]").count() == 0


def test_the_strip_fits_a_phone_and_can_be_read(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.alerts.heat(gateway.robots[0])
    for _ in range(4):
        gateway.alerts.add("sim_1", gateway.seconds() - 60, title="A value shakes more, or less, than usual")
    page = open_page(gateway.url, size=PHONE, touch=True)
    expect(page.locator(".alert-badge").first).to_be_visible()
    faults = unreadable(page, "fleet")
    page.goto(f"{gateway.url}/robots/sim_1")
    expect(page.locator("[data-open-alerts='5']")).to_be_visible()
    assert faults + unreadable(page, "robot") == []
