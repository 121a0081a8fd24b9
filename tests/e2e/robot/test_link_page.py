"""The link tab in a real browser: round trip, what waits, back-fill, losses, and the slider of the uplink."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.conftest import PHONE
from tests.e2e.fake.gateway import FakeGateway
from tests.e2e.readable import unreadable

pytestmark = [pytest.mark.browser, pytest.mark.xdist_group("browser")]

OpenPage = Callable[..., Page]
LINK = "/robots/sim_1?tab=link"


@pytest.mark.usefixtures("quiet")
def test_the_tab_shows_the_link_and_that_nothing_waits(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{gateway.url}/robots/sim_1")
    page.get_by_role("button", name="Link").click()
    card = page.locator("[data-card=connection]")
    expect(card).to_contain_text("1.2\u202fms")
    expect(card).to_contain_text("gRPC · 127.0.0.1:8081")
    expect(card).to_contain_text("agrees")
    expect(page.locator("[data-class]")).to_have_count(4)
    expect(page.locator("[data-card=backfill]")).to_contain_text("Up to date")
    expect(page.locator("[data-card=gaps]")).to_contain_text("None.")
    page.wait_for_function("() => document.querySelector('.rtt-line polyline')?.points.length > 1")
    page.reload()
    expect(page.locator("[data-card=connection]")).to_be_visible()


def test_backfill_is_seen_to_go_away(gateway: FakeGateway, open_page: OpenPage) -> None:
    robot = gateway.robots[0]
    robot.waiting_bytes = 40_000_000
    page = open_page(gateway.url + LINK)
    card = page.locator("[data-card=backfill]")
    expect(card).to_contain_text("40.0\u202fMB")
    expect(page.locator("[data-class=bulk] .late")).to_be_visible()
    robot.waiting_bytes = 10_000_000
    expect(card.get_by_role("progressbar")).to_have_attribute("aria-valuenow", "75")
    expect(card).to_contain_text("Done in about")
    robot.waiting_bytes = 0
    expect(card).to_contain_text("Up to date")


def test_losses_are_reported_with_their_reasons(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.robots[0].gaps = 2
    page = open_page(gateway.url + LINK)
    rows = page.locator(".gaps tbody tr")
    expect(rows).to_have_count(2)
    expect(rows.nth(0)).to_contain_text("scan")
    expect(rows.nth(0)).to_contain_text("1,001 – 3,500")
    expect(rows.nth(0)).to_contain_text("the oldest went")
    expect(rows.nth(1)).to_contain_text("<b>odd</b>")
    expect(rows.nth(1)).to_contain_text("metric rows")


def test_the_slider_sets_the_budget_and_shows_it(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(gateway.url + LINK)
    card, slider = page.locator("[data-card=uplink]"), page.get_by_label("Byte budget of the uplink")
    expect(card).to_contain_text("No limit")
    expect(slider).to_be_enabled()  # once it is known who uses the page: before, a key would go nowhere
    slider.focus()
    slider.press("Home")
    expect(page.locator("[data-limit='5000']")).to_be_visible()
    assert gateway.robots[0].budget_bytes_per_s == 5000
    expect(card).to_contain_text("100 % of it is used")
    gateway.robots[0].budget_bytes_per_s = 130_000  # somebody else, by the API
    expect(page.locator("[data-limit='130000']")).to_be_visible()
    expect(card).to_contain_text("130\u202fkB/s")
    expect(slider).to_have_value("4")
    slider.focus()
    slider.press("End")
    expect(page.locator("[data-limit=none]")).to_be_visible()


def test_a_refused_budget_is_said_and_the_slider_goes_back(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.refuses_uplink = True
    page = open_page(gateway.url + LINK)
    slider = page.get_by_label("Byte budget of the uplink")
    expect(slider).to_be_enabled()
    slider.focus()
    slider.press("Home")
    expect(page.get_by_role("alert")).to_contain_text("this agent is too old")
    expect(slider).to_have_value("13")


def test_an_offline_robot_takes_no_budget(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.robots[0].state = "offline"
    page = open_page(gateway.url + LINK)
    expect(page.get_by_label("Byte budget of the uplink")).to_be_disabled()
    expect(page.locator("[data-card=backfill]")).to_contain_text("Offline")


def test_it_fits_a_phone_and_can_be_read(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.robots[0].gaps, gateway.robots[0].waiting_bytes = 2, 1_000_000
    page = open_page(gateway.url + LINK, size=PHONE, touch=True)
    expect(page.locator(".gaps tbody tr")).to_have_count(2)
    assert unreadable(page) == []
