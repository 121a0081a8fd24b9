"""How much the browser fetches before a page is there: at most 60 kB, compressed."""

from __future__ import annotations

import gzip
from collections.abc import Callable

import pytest
from playwright.sync_api import Page, Response, expect

from gateway.api.views_identity import account_view
from gateway.domain.principal import Role, anonymous_viewer
from tests.e2e.fake_gateway import FakeGateway, account

pytestmark = [pytest.mark.browser, pytest.mark.xdist_group("browser")]

BUDGET_BYTES = 60_000
OpenPage = Callable[..., Page]
Fetched = dict[str, int]


def watch(page: Page) -> Fetched:
    """From now on: what of the dashboard's own files is fetched, and its compressed size."""
    fetched: Fetched = {}

    def note(response: Response) -> None:
        if "/api/" not in response.url and response.status == 200:
            fetched[response.url.rpartition("/")[2]] = len(gzip.compress(response.body(), 9))

    page.on("response", note)
    return fetched


def test_the_fleet_is_within_the_budget_with_everything(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page("about:blank", own=True)
    fetched = watch(page)
    page.goto(gateway.url)
    expect(page.locator("tr[data-robot]")).to_have_count(3)
    assert 20_000 < sum(fetched.values()) <= BUDGET_BYTES, fetched
    assert not [name for name in fetched if "worker" in name], "nothing is decoded for it"


def code(fetched: Fetched) -> Fetched:
    """The scripts among it, without the decoder's, which runs beside the page."""
    return {name: size for name, size in fetched.items() if name.endswith(".js") and "worker" not in name}


def open_robot(page: Page, gateway: FakeGateway) -> Fetched:
    """The page with its map and plots."""
    fetched = watch(page)
    page.goto(f"{gateway.url}/robots/sim_1")
    for card in ("map", "camera", "teleop", "plot"):
        expect(page.locator(f"[data-card={card}]").first).to_be_visible()
    page.wait_for_function("() => Number(document.querySelector('[data-card=map] canvas')?.dataset.scans) > 1")
    page.wait_for_load_state("networkidle")  # a card may be there before the code that draws in it
    return fetched


def test_a_robot_with_map_and_plots_is_within_the_budget_of_code(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.account = account(Role.VIEWER)
    page = open_page("about:blank", own=True)
    fetched = code(open_robot(page, gateway))
    assert 40_000 < sum(fetched.values()) <= BUDGET_BYTES, fetched


def test_what_operators_do_comes_to_operators_alone(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page("about:blank", own=True)
    fetched = code(open_robot(page, gateway))
    expect(page.locator(".pad")).to_be_visible()
    (pad,) = (size for name, size in fetched.items() if name.startswith("teleop-"))
    assert sum(fetched.values()) - pad <= BUDGET_BYTES, fetched
    others = ("admin", "alerts", "commands", "config", "functions", "link", "nodes", "past", "recordings", "rollouts")
    others += ("rules", "sign_in")
    assert not [name for name in fetched if name.startswith(others)]


@pytest.mark.parametrize(
    "path",
    [
        "/signin",
        "/graph",
        "/alerts",
        "/functions",
        "/functions?show=runtime",
        "/functions/dock_when_low",
        "/functions/dock_when_low?tab=code",
        "/recordings",
        "/rollouts",
        "/rollouts/versions",
        "/rules",
        "/rules?show=hooks",
        "/robots/sim_1?tab=commands",
    ],
)
def test_other_pages_are_within_the_budget(gateway: FakeGateway, open_page: OpenPage, path: str) -> None:
    gateway.account = account_view(anonymous_viewer(), has_password=False)
    gateway.functions.world()
    gateway.rules.world()
    page = open_page("about:blank", own=True)
    fetched = watch(page)
    page.goto(gateway.url + path)
    expect(page.locator("h1").first).to_be_visible()
    assert 20_000 < sum(fetched.values()) <= BUDGET_BYTES, fetched


def test_an_alert_with_its_plot_is_within_the_budget_of_code(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.account = account(Role.VIEWER)
    hot = gateway.alerts.heat(gateway.robots[0])
    page = open_page("about:blank", own=True)
    fetched = watch(page)
    page.goto(f"{gateway.url}/alerts/{hot['id']}")
    expect(page.locator("[data-card=band] canvas")).to_be_visible()
    assert 40_000 < sum(code(fetched).values()) <= BUDGET_BYTES, fetched


def test_the_editor_of_rules_is_within_the_budget(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.account = account(Role.ADMIN)
    gateway.rules.world()
    page = open_page("about:blank", own=True)
    fetched = watch(page)
    page.goto(f"{gateway.url}/rules/battery_low")
    expect(page.get_by_label("The rule as JSON")).to_be_visible()
    page.wait_for_load_state("networkidle")
    assert 40_000 < sum(fetched.values()) <= BUDGET_BYTES, fetched


@pytest.mark.parametrize("tab", ["topics", "graph", "nodes", "config"])
def test_a_tab_that_is_opened_first_is_within_the_budget(gateway: FakeGateway, open_page: OpenPage, tab: str) -> None:
    gateway.account = account(Role.VIEWER)
    page = open_page("about:blank", own=True)
    fetched = watch(page)
    with page.expect_response(lambda answer: f"/{tab}-" in answer.url and answer.url.endswith(".js")):
        page.goto(f"{gateway.url}/robots/sim_1?tab={tab}")
    page.wait_for_load_state("networkidle")
    assert 20_000 < sum(fetched.values()) <= BUDGET_BYTES, fetched
