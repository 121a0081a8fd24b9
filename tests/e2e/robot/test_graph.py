"""The Graph page and tab in a real browser: what is drawn, what is chosen, what cannot get through."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import combinations

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.e2e.conftest import DESKTOP, PHONE
from tests.e2e.fake.gateway import FakeGateway
from tests.e2e.readable import unreadable

pytestmark = [pytest.mark.browser, pytest.mark.xdist_group("browser")]

OpenPage = Callable[..., Page]


def opened(gateway: FakeGateway, open_page: OpenPage, query: str = "", **options: object) -> Page:
    page = open_page(f"{gateway.url}/robots/sim_1?tab=graph{query}", **options)
    expect(page.locator("[data-vertex]")).to_have_count(16)
    return page


def vertex(page: Page, name: str) -> Locator:
    """A topic, or the one node that is asked for here."""
    kind = "node" if name == "planner" else "topic"
    return page.locator(f"[data-vertex='/sim_1/{name}'][data-kind={kind}]")


def test_all_stand_apart_arrows_lead_right_problems_are_said_and_a_search_narrows(
    gateway: FakeGateway, open_page: OpenPage
) -> None:
    page = opened(gateway, open_page)
    boxes = [box for each in page.locator("[data-vertex] rect").all() if (box := each.bounding_box())]
    assert len(boxes) == 16
    for one, other in combinations(boxes, 2):
        apart = one["x"] + one["width"] <= other["x"] or other["x"] + other["width"] <= one["x"]
        assert apart or one["y"] + one["height"] <= other["y"] or other["y"] + other["height"] <= one["y"]
    order = [vertex(page, name).bounding_box() for name in ("scan", "planner")]
    assert order[0] is not None
    assert order[1] is not None
    assert order[0]["x"] < order[1]["x"]
    expect(page.locator(".graph-edge")).to_have_count(15)
    expect(page.locator(".graph-still")).to_have_count(2)  # nothing flows on cmd_vel

    problems = page.locator(".graph-problems li")
    expect(problems).to_have_count(1)
    expect(problems).to_contain_text("best effort is offered, reliable is asked for")
    expect(page.locator(".graph-broken")).to_have_attribute("data-edge", "topic /sim_1/note > node /sim_1/watchdog")
    problems.get_by_role("button").click()
    expect(page.locator("[data-facts='/sim_1/note']")).to_be_visible()

    page.get_by_role("searchbox").fill("imu")
    expect(page.locator("[data-vertex]")).to_have_count(3)
    page.get_by_role("searchbox").fill("no such thing")
    expect(page.locator(".nothing")).to_be_visible()


def test_what_is_chosen_shows_its_neighbours_and_is_in_the_address(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = opened(gateway, open_page)
    vertex(page, "planner").click()
    facts = page.locator("[data-facts='/sim_1/planner']")
    for said in ("Publishes", "cmd_vel", "Hears", "odom", "scan", "set_parameters", "navigate"):
        expect(facts).to_contain_text(said)
    expect(page).to_have_url(re.compile(r"at=node"))
    expect(page.locator(".graph-vertex.graph-near")).to_have_count(4)
    vertex(page, "odom").focus()
    page.keyboard.press("Enter")
    facts = page.locator("[data-facts='/sim_1/odom']")
    expect(facts).to_contain_text("10.0\u202fHz")
    facts.get_by_role("link", name="See its messages").click()
    expect(page.locator("[data-message='/sim_1/odom'] [data-path='pose.pose.position.x']")).to_be_visible()


def test_a_robot_that_tells_no_graph_says_so(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.graph.known = False
    page = open_page(f"{gateway.url}/robots/sim_1?tab=graph")
    expect(page.locator(".nothing")).to_contain_text("has not reported its graph")
    page.goto(f"{gateway.url}/graph")
    expect(page.locator(".nothing")).to_contain_text("No robot")


def test_the_fleets_graphs_lead_to_each_robots(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(gateway.url)
    page.get_by_role("link", name="Graph").click()
    cards = page.locator(".graph-card")
    expect(cards).to_have_count(3)
    expect(cards.first).to_contain_text("8 topics")
    expect(cards.first.locator(".graph-mini")).to_have_count(16)
    expect(page.locator(".count-attention")).to_have_text("3 with problems")
    problem = "note /sim_1/watchdog hears nothing: best effort is offered, reliable is asked for"
    expect(cards.first.get_by_role("list", name="Problems")).to_have_text(problem)
    page.get_by_role("link", name="sim_2").click()
    expect(page.locator("[data-vertex='/sim_2/odom']")).to_be_visible()


def test_where_all_gets_through_there_is_no_problem_though_nobody_drives(
    gateway: FakeGateway, open_page: OpenPage
) -> None:
    gateway.graph.healthy = True
    page = open_page(f"{gateway.url}/graph")
    expect(page.locator(".graph-card")).to_have_count(3)
    expect(page.locator(".counts")).to_have_text("3 robotsno problems")
    expect(page.get_by_role("list", name="Problems")).to_have_count(0)
    page.get_by_role("link", name="sim_2").click()
    expect(page.locator("[data-waiting]")).to_have_text("Subscribed, but published by nobody now: cmd_vel")
    expect(page.get_by_role("list", name="Problems")).to_have_count(0)


def test_it_fits_a_phone_and_can_be_read(gateway: FakeGateway, open_page: OpenPage) -> None:
    faults = []
    for size, touch, word in ((DESKTOP, False, "desktop"), (PHONE, True, "phone")):
        page = opened(gateway, open_page, size=size, touch=touch)
        faults += unreadable(page, word, shot=f"graph-{word}", whole=True)
        vertex(page, "planner").click()
        expect(page.locator("[data-facts]")).to_be_visible()
        faults += unreadable(page, f"{word}, chosen", shot=f"graph-chosen-{word}", whole=True)
        page.goto(f"{gateway.url}/graph")
        expect(page.locator(".graph-card")).to_have_count(3)
        faults += unreadable(page, f"{word}, all", shot=f"graphs-{word}", whole=True)
    assert faults == []
