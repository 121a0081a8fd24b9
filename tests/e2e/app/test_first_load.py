"""How much the browser fetches before a page is there: at most 60 kB, compressed."""

from __future__ import annotations

import gzip
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Page, Response, expect

from gateway.api.views.identity import account_view
from gateway.domain.principal import Role, anonymous_viewer
from tests.e2e.fake.gateway import FakeGateway, account

pytestmark = [pytest.mark.browser, pytest.mark.xdist_group("browser")]

BUDGET_BYTES = 60_000
OpenPage = Callable[..., Page]
Fetched = dict[str, int]
PATHS = (
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
)


@pytest.fixture
def page(open_page: OpenPage) -> Page:
    """Not yet anywhere."""
    return open_page("about:blank")


@contextmanager
def watched(page: Page) -> Iterator[Fetched]:
    """Meanwhile: what of the dashboard's own files is fetched, and its compressed size."""
    fetched: Fetched = {}

    def note(response: Response) -> None:
        if "/api/" not in response.url and response.status == 200:
            fetched[response.url.rpartition("/")[2]] = compressed(response)

    page.on("response", note)
    yield fetched
    page.remove_listener("response", note)


SIZES: Fetched = {}


def compressed(response: Response) -> int:
    """Its size; a name with a hash is that of one content."""
    if response.url not in SIZES or "/assets/" not in response.url:
        SIZES[response.url] = len(gzip.compress(response.body(), 9))
    return SIZES[response.url]


def code(fetched: Fetched) -> Fetched:
    """The scripts among it, without the decoder's, which runs beside the page."""
    return {name: size for name, size in fetched.items() if name.endswith(".js") and "worker" not in name}


def open_robot(page: Page, gateway: FakeGateway) -> Fetched:
    """The page with its map and plots."""
    with watched(page) as fetched:
        page.goto(f"{gateway.url}/robots/sim_1")
        for card in ("map", "camera", "teleop", "plot"):
            expect(page.locator(f"[data-card={card}]").first).to_be_visible()
        page.wait_for_function("() => Number(document.querySelector('[data-card=map] canvas')?.dataset.scans) > 1")
        page.wait_for_load_state("networkidle")  # a card may be there before the code that draws in it
    return fetched


def test_the_fleet_is_within_the_budget_with_everything(gateway: FakeGateway, page: Page) -> None:
    with watched(page) as fetched:
        page.goto(gateway.url)
        expect(page.locator("tr[data-robot]")).to_have_count(3)
    assert 20_000 < sum(fetched.values()) <= BUDGET_BYTES, fetched
    assert not [name for name in fetched if "worker" in name], "nothing is decoded for it"


def test_a_robot_with_map_and_plots_is_within_the_budget_of_code(gateway: FakeGateway, page: Page) -> None:
    gateway.account = account(Role.VIEWER)
    fetched = code(open_robot(page, gateway))
    assert 40_000 < sum(fetched.values()) <= BUDGET_BYTES, fetched


def test_what_operators_do_comes_to_operators_alone(gateway: FakeGateway, page: Page) -> None:
    fetched = code(open_robot(page, gateway))
    expect(page.locator(".pad")).to_be_visible()
    (pad,) = (size for name, size in fetched.items() if name.startswith("teleop-"))
    assert sum(fetched.values()) - pad <= BUDGET_BYTES, fetched
    others = ("admin", "alerts", "commands", "config", "functions", "link", "nodes", "past", "recordings", "rollouts")
    others += ("rules", "sign_in")
    assert not [name for name in fetched if name.startswith(others)]


def test_other_pages_are_within_the_budget(gateway: FakeGateway, page: Page) -> None:
    gateway.account = account_view(anonymous_viewer(), has_password=False)
    gateway.functions.world()
    gateway.rules.world()
    failures = []
    for path in PATHS:
        page.goto("about:blank")
        with watched(page) as fetched:
            page.goto(gateway.url + path)
            expect(page.locator("h1").first).to_be_visible()
        if not 20_000 < sum(fetched.values()) <= BUDGET_BYTES:
            failures.append((path, fetched))
    assert failures == []


def test_an_alert_with_its_plot_is_within_the_budget_of_code(gateway: FakeGateway, page: Page) -> None:
    gateway.account = account(Role.VIEWER)
    hot = gateway.alerts.heat(gateway.robots[0])
    with watched(page) as fetched:
        page.goto(f"{gateway.url}/alerts/{hot['id']}")
        expect(page.locator("[data-card=band] canvas")).to_be_visible()
        page.wait_for_load_state("networkidle")  # a card may be there before the code that draws in it
    assert 40_000 < sum(code(fetched).values()) <= BUDGET_BYTES, fetched


def test_the_editor_of_rules_is_within_the_budget(gateway: FakeGateway, page: Page) -> None:
    gateway.account = account(Role.ADMIN)
    gateway.rules.world()
    with watched(page) as fetched:
        page.goto(f"{gateway.url}/rules/battery_low")
        expect(page.get_by_label("The rule as JSON")).to_be_visible()
        page.wait_for_load_state("networkidle")
    assert 40_000 < sum(fetched.values()) <= BUDGET_BYTES, fetched


def test_a_tab_that_is_opened_first_is_within_the_budget(gateway: FakeGateway, page: Page) -> None:
    gateway.account = account(Role.VIEWER)
    failures = []
    for tab in ("topics", "graph", "nodes", "config"):
        page.goto("about:blank")
        name = re.compile(rf"/{tab}-[^/]*\.js$")
        with watched(page) as fetched, page.expect_response(name):
            page.goto(f"{gateway.url}/robots/sim_1?tab={tab}")
            page.wait_for_load_state("networkidle")
        if not 20_000 < sum(fetched.values()) <= BUDGET_BYTES:
            failures.append((tab, fetched))
    assert failures == []
