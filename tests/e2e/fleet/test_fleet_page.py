"""The fleet page in a real browser."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.conftest import PHONE
from tests.e2e.fake.gateway import FakeGateway
from tests.e2e.fake.robots import FakeRobot
from tests.e2e.readable import unreadable

pytestmark = [pytest.mark.browser, pytest.mark.xdist_group("browser")]

OpenPage = Callable[..., Page]
NAMES = "[...document.querySelectorAll('tr[data-robot]')].map(row => row.dataset.robot)"
PROBE = "window.__ran = true"


def test_robots_are_listed_worst_first_with_live_values_explained_and_searched(
    gateway: FakeGateway, open_page: OpenPage
) -> None:
    page = open_page(gateway.url)
    expect(page.locator("tr[data-robot]")).to_have_count(3)
    expect(page.locator(".counts")).to_contain_text("3 robots")
    page.wait_for_function(f"{NAMES}.join() === 'sim_2,sim_1,sim_3'")
    expect(page.locator("tr[data-robot=sim_2]")).to_contain_text("battery low")
    expect(page.locator("tr[data-robot=sim_1] [data-label=Battery]")).to_contain_text("80\u202f%")
    cpu = "tr[data-robot=sim_1] [data-series='host.cpu.percent']"
    first = page.locator(cpu).get_attribute("data-value")
    page.wait_for_function(f"first => document.querySelector({cpu!r}).dataset.value !== first", arg=first)

    page.keyboard.press("?")
    expect(page.locator("dialog")).to_be_visible()
    page.keyboard.press("Escape")
    expect(page.locator("dialog")).to_be_hidden()

    page.keyboard.press("/")
    page.keyboard.type("sim_3")
    expect(page.locator("tr[data-robot]")).to_have_count(1)
    assert page.url.endswith("/?q=sim_3")
    page.reload()
    expect(page.locator("tr[data-robot]")).to_have_count(1)


def test_a_robot_that_goes_offline_is_greyed_and_first(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(gateway.url)
    expect(page.locator("tr[data-robot=sim_3] [data-series='battery_state.percentage']")).to_be_visible()
    gateway.robots[2].state = "offline"
    page.wait_for_function(f"{NAMES}[0] === 'sim_3'")
    row = page.locator("tr[data-robot=sim_3]")
    expect(row.locator("[data-state=offline]")).to_have_text("offline")
    expect(row.locator("[data-series='battery_state.percentage']")).to_have_attribute("data-stale", "true")
    expect(row.locator("[data-label='Last seen']")).to_contain_text("ago")


def test_no_robots_says_what_to_run(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.robots.clear()
    expect(open_page(gateway.url).locator("pre")).to_contain_text("metaros up --robots 3")


def test_page_recovers_when_the_gateway_restarts(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(gateway.url)
    expect(page.locator("[data-stream=open]")).to_be_visible()
    expect(page.locator("tr[data-robot]")).to_have_count(3)
    gateway.stop()
    expect(page.locator("[data-stream=lost]")).to_have_text("Reconnecting…")
    expect(page.locator("tr[data-robot]")).to_have_count(3)
    gateway.robots.append(FakeRobot("sim_4", "/sim_4"))
    gateway.start()
    expect(page.locator("[data-stream=open]")).to_be_visible()
    expect(page.locator("tr[data-robot]")).to_have_count(4)


@pytest.mark.usefixtures("quiet")
def test_names_and_messages_of_robots_are_harmless(gateway: FakeGateway, open_page: OpenPage) -> None:
    evil = f'<img src=x onerror="{PROBE}">'
    gateway.robots[0].id = gateway.robots[0].note = evil
    page = open_page(gateway.url)
    page.locator(".robot-link", has_text=evil).click()
    expect(page.locator("h1")).to_have_text(evil)
    card = page.locator("details[data-topic='/sim_1/note']")
    card.locator("summary").click()
    expect(card.locator("dd")).to_have_text(evil)
    assert page.evaluate("window.__ran") is None
    assert page.locator("img").count() == 0


def test_phone_shows_cards_and_nothing_wider_than_the_screen(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(gateway.url, size=PHONE, touch=True)
    expect(page.locator("tr[data-robot]")).to_have_count(3)
    assert page.locator("thead").is_hidden()
    for path in ("/", "/robots/sim_1", "/robots/sim_1?tab=topics"):
        page.goto(gateway.url + path)
        expect(page.locator("main h1, main .counts").first).to_be_visible()
        assert page.evaluate("document.documentElement.scrollWidth") == PHONE["width"], path


def test_text_has_contrast_of_level_aa(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(gateway.url)
    expect(page.locator("tr[data-robot]")).to_have_count(3)
    faults = unreadable(page, "fleet")
    for path in ("/robots/sim_1", "/robots/sim_1?tab=topics"):
        page.goto(gateway.url + path)
        expect(page.locator("[data-card=teleop], table.topics").first).to_be_visible()
        faults += unreadable(page, path)
    assert faults == []
