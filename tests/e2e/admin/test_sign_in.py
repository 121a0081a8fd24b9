"""Signing in, in a real browser at a real gateway: by password, by link, elsewhere; and what each role is offered."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from gateway.cli.accounts import local_store
from gateway.identity.lockout import address_group
from gateway.identity.secret_text import secret_hash
from gateway.store.accounts.sessions import Failures, write_failures
from metaros.clock import SystemClock
from tests.e2e.conftest import PHONE, save
from tests.e2e.real.gateway import PASSWORD, RealGateway, real_gateway
from tests.support.servers.oidc_server import CLIENT_ID, CLIENT_SECRET, oidc_server

pytestmark = [
    pytest.mark.browser,
    pytest.mark.integration,
    pytest.mark.xdist_group("browser"),
    pytest.mark.timeout(300),
]

OpenPage = Callable[..., Page]
PLACE = "/robots/sim_1?t=2026-11-21T06:00:00Z&span=1h"
BUDGET = "Byte budget of the uplink"


@pytest.fixture(scope="module")
def open_to_all(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RealGateway]:
    with real_gateway(tmp_path_factory.mktemp("open")) as running:
        yield running


@pytest.fixture(scope="module")
def closed_to_strangers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RealGateway]:
    with real_gateway(tmp_path_factory.mktemp("closed"), anonymous=False) as running:
        yield running


@contextmanager
def with_ada(running: RealGateway) -> Iterator[RealGateway]:
    """There is a new ada, an operator, for as long."""
    running.user("ada", "operator")
    yield running
    if any(user["name"] == "ada" for user in running.ask("GET", "/users")["users"]):
        running.ask("DELETE", "/users/ada")


@pytest.fixture
def gateway(open_to_all: RealGateway) -> Iterator[RealGateway]:
    """Open to viewers, as on a machine of one's own; ada is an operator."""
    with with_ada(open_to_all) as running:
        yield running


@pytest.fixture
def closed(closed_to_strangers: RealGateway) -> Iterator[RealGateway]:
    """It shows nothing to who is not known; ada is an operator."""
    with with_ada(closed_to_strangers) as running:
        yield running


def enter(page: Page, name: str = "ada", password: str = PASSWORD) -> None:
    """Type into the form, and Enter."""
    page.get_by_label("Name").fill(name)
    page.get_by_label("Password", exact=True).fill(password)
    page.get_by_label("Password", exact=True).press("Enter")


def signed_in(page: Page, name: str, role: str) -> None:
    """The bar says so."""
    expect(page.locator(f"[data-account='{name}'][data-role={role}]")).to_be_visible()


def test_a_password_leads_back_to_the_very_instant(closed: RealGateway, open_page: OpenPage) -> None:
    page = open_page(closed.url + PLACE)
    expect(page.get_by_role("heading", name="Sign in")).to_be_visible()
    expect(page.get_by_label("Name")).to_be_focused()
    expect(page.locator("nav[aria-label=Main]")).to_have_count(0)
    save(page, "signin-desktop")
    enter(page, password="wrong horse battery")
    expect(page.get_by_role("alert")).to_have_text("The name or the password is wrong.")
    enter(page, name="nobody")
    expect(page.get_by_role("alert")).to_have_text("The name or the password is wrong.")
    save(page, "signin-wrong")
    enter(page)
    expect(page.get_by_role("heading", name="sim_1")).to_be_visible()
    assert page.url == closed.url + PLACE
    expect(page.locator(".timebar[data-mode=past]")).to_be_visible()
    signed_in(page, "ada", "operator")
    page.reload()
    signed_in(page, "ada", "operator")
    assert page.url == closed.url + PLACE


def test_a_viewer_is_offered_nothing_that_operators_do_and_an_operator_at_once(
    gateway: RealGateway, open_page: OpenPage
) -> None:
    page = open_page(f"{gateway.url}/robots/sim_1", own=True)
    expect(page.locator("[data-account=anonymous]")).to_contain_text("Viewer")
    expect(page.locator("[data-card=teleop]")).to_contain_text("Operators may drive.")
    for control in (page.locator(".pad"), page.get_by_role("button", name="Resume autonomy"), page.locator(".save")):
        expect(control).to_have_count(0)
    save(page, "viewer-robot")
    page.goto(f"{gateway.url}/recordings")
    expect(page.locator("[data-may-not='save clips']")).to_be_visible()
    expect(page.locator(".save-form")).to_have_count(0)
    page.goto(f"{gateway.url}/robots/sim_1?tab=link")
    expect(page.get_by_label(BUDGET)).to_be_disabled()
    tokens: list[str | None] = []
    page.on("request", lambda asked: asked.method == "PUT" and tokens.append(asked.headers.get("x-csrf-token")))
    page.locator("[data-account] a").click()
    expect(page.get_by_role("heading", name="Sign in")).to_be_visible()
    enter(page)
    page.wait_for_url("**/robots/sim_1?tab=link")
    slider = page.get_by_label(BUDGET)
    expect(slider).to_be_enabled()
    slider.press("Home")
    expect(page.locator("[data-card=uplink] [data-limit='5000']")).to_be_visible()
    assert tokens, "it was sent"
    assert all(tokens), "a session's mutation carries its token"
    page.get_by_role("button", name="Live", exact=True).click()
    page.locator(".pad").focus()
    page.keyboard.down("KeyW")
    expect(page.locator("[data-teleop=holding]")).to_be_visible()
    page.keyboard.up("KeyW")
    expect(page.get_by_role("button", name="Save last 60 s")).to_be_visible()
    save(page, "operator-robot")


def test_the_first_link_signs_in_once_and_asks_for_a_password(closed: RealGateway, open_page: OpenPage) -> None:
    link = closed.link()
    page = open_page(link)
    expect(page.get_by_role("heading", name="Welcome, admin")).to_be_visible()
    assert page.url == f"{closed.url}/signin", "the secret has left the address"
    save(page, "signin-first")
    page.get_by_label("New password").fill("short")
    page.get_by_role("button", name="Save password").click()
    expect(page.get_by_role("heading", name="Welcome, admin")).to_be_visible()
    page.get_by_label("New password").fill(PASSWORD)
    page.get_by_label("The same again").fill(PASSWORD + "x")
    page.get_by_role("button", name="Save password").click()
    expect(page.get_by_role("alert")).to_have_text("The two are not the same.")
    page.get_by_label("The same again").fill(PASSWORD)
    page.get_by_label("The same again").press("Enter")
    page.wait_for_url(f"{closed.url}/")
    signed_in(page, "admin", "admin")
    other = open_page(link, size=PHONE, touch=True)
    expect(other.get_by_role("alert").first).to_contain_text("This link is not good any more")
    assert other.url == f"{closed.url}/signin"
    save(other, "signin-stale-phone")
    enter(other, "admin")
    other.wait_for_url(f"{closed.url}/")
    expect(other.locator("tr[data-robot]")).to_have_count(1)
    save(other, "fleet-phone-signed-in")


def test_a_link_pasted_into_an_open_sign_in_page_works(closed: RealGateway, open_page: OpenPage) -> None:
    page = open_page(f"{closed.url}/signin")
    expect(page.get_by_label("Name")).to_be_visible()
    page.goto(closed.link("ada"))  # only the fragment differs: the browser does not load the page again
    page.wait_for_url(f"{closed.url}/")
    signed_in(page, "ada", "operator")


def test_whoever_tried_too_often_is_reported_to_wait(tmp_path: Path, open_page: OpenPage) -> None:
    with local_store(tmp_path / "data", "") as store:
        now_ns = SystemClock().wall_ns()
        tried = Failures(failures=13, last_ns=now_ns, until_ns=now_ns + 200 * 10**9)
        store.run(lambda engine: write_failures(engine, secret_hash("ada"), address_group("127.0.0.1"), tried))
    with real_gateway(tmp_path, anonymous=False) as running:
        running.user("ada", "operator")
        page = open_page(running.url, own=True)
        enter(page)
        button = page.get_by_role("button", name="Wait")
        expect(button).to_be_visible()
        said = button.inner_text()
        save(page, "signin-locked")
        page.wait_for_function("said => document.querySelector('.button-wide').innerText !== said", arg=said)
        expect(page.get_by_role("alert")).to_contain_text("Too many attempts")
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.get_by_label("Password", exact=True).press("Enter")
        enter(page)
        assert not [url for url in asked if url.endswith("/auth/login")], "it waits"


def test_signing_out(gateway: RealGateway, open_page: OpenPage) -> None:
    page = open_page(f"{gateway.url}/signin?back=%2Frobots%2Fsim_1")
    enter(page)
    expect(page.locator(".pad")).to_be_visible()
    page.get_by_role("button", name="Account: ada").click()
    expect(page.get_by_role("link", name="API keys")).to_be_visible()
    save(page, "account-menu")
    page.get_by_role("button", name="Sign out").click()
    expect(page.locator("[data-account=anonymous]")).to_be_visible()
    expect(page.locator(".pad")).to_have_count(0)
    expect(page.get_by_role("heading", name="sim_1")).to_be_visible()
    assert [cookie["name"] for cookie in page.context.cookies()] == []


def test_a_password_is_changed_from_the_menu(closed: RealGateway, open_page: OpenPage) -> None:
    page = open_page(closed.url)
    enter(page)
    page.get_by_role("button", name="Account: ada").click()
    page.get_by_role("button", name="Change password").click()
    dialog = page.get_by_role("dialog", name="Change password")
    for label, text in (
        ("Present password", "not this battery"),
        ("New password", PASSWORD * 2),
        ("The same", PASSWORD * 2),
    ):
        dialog.get_by_label(label).fill(text)
    dialog.get_by_role("button", name="Save password").click()
    expect(dialog.get_by_role("alert")).to_have_text("The old password is wrong.")
    signed_in(page, "ada", "operator")
    save(page, "password-dialog")
    dialog.get_by_label("Present password").fill(PASSWORD)
    dialog.get_by_role("button", name="Save password").click()
    expect(dialog).to_have_count(0)
    page.get_by_role("button", name="Account: ada").click()
    page.get_by_role("button", name="Sign out").click()
    expect(page.get_by_role("heading", name="Sign in")).to_be_visible()
    expect(page.locator(".signin-lead")).not_to_contain_text("has ended")
    enter(page, password=PASSWORD * 2)
    signed_in(page, "ada", "operator")


def test_rights_that_change_are_felt_while_looking(closed: RealGateway, open_page: OpenPage) -> None:
    page = open_page(f"{closed.url}/robots/sim_1?span=1h")
    enter(page)
    expect(page.locator(".pad")).to_be_visible()
    closed.ask("PATCH", "/users/ada", {"role": "viewer"})
    signed_in(page, "ada", "viewer")
    expect(page.locator("[data-card=teleop]")).to_contain_text("ada is a viewer")
    expect(page.locator("[data-stream=open]")).to_be_visible()
    closed.ask("PATCH", "/users/ada", {"role": "operator"})
    expect(page.locator(".pad")).to_be_visible()
    closed.ask("PATCH", "/users/ada", {"disabled": True})
    expect(page.get_by_role("heading", name="Sign in")).to_be_visible()
    expect(page.locator(".signin-lead")).to_have_text("The session of ada has ended.")
    expect(page.get_by_label("Name")).to_have_value("ada")
    save(page, "signin-ended")
    closed.ask("PATCH", "/users/ada", {"disabled": False})
    enter(page)
    expect(page.locator(".pad")).to_be_visible()
    expect(page.locator("[data-stream=open]")).to_be_visible()
    assert page.url == f"{closed.url}/robots/sim_1?span=1h"


def test_a_session_that_ended_where_anybody_may_look_is_no_dead_end(gateway: RealGateway, open_page: OpenPage) -> None:
    page = open_page(f"{gateway.url}/signin?back=%2Frobots%2Fsim_1")
    enter(page)
    expect(page.locator(".pad")).to_be_visible()
    gateway.ask("DELETE", "/users/ada")
    expect(page.get_by_role("button", name="Go on as a viewer")).to_be_visible()
    page.get_by_role("button", name="Go on as a viewer").click()
    expect(page.locator("[data-account=anonymous]")).to_be_visible()
    expect(page.get_by_role("heading", name="sim_1")).to_be_visible()
    expect(page.locator(".pad")).to_have_count(0)
    page.reload()
    expect(page.locator("[data-account=anonymous]")).to_be_visible()
    expect(page.locator("[data-stream=open]")).to_be_visible()


def test_signing_in_remote_leads_back_too(tmp_path: Path, free_port: int, open_page: OpenPage) -> None:
    with oidc_server() as provider:
        path = tmp_path / "oidc.json"
        document = {
            "issuer": provider.issuer,
            "client_id": CLIENT_ID,
            "client_secret": CLIENT_SECRET,
            "redirect_url": f"http://127.0.0.1:{free_port}/api/v1/auth/oidc/callback",
            "name": "Example Lab",
            "roles": {"viewer": ["robot-lookers"], "operator": ["robot-ops"], "admin": ["robot-admins"]},
            "robots": ["sim_*"],
        }
        path.write_text(json.dumps(document))
        path.chmod(0o600)
        with real_gateway(tmp_path, anonymous=False, oidc=path, port=free_port) as running:
            page = open_page(running.url + PLACE, scheme="dark")
            button = page.get_by_role("link", name="Sign in with Example Lab")
            expect(button).to_be_visible()
            save(page, "signin-oidc-dark")
            provider.claims = {"groups": []}
            button.click()
            refusal = page.get_by_role("alert").filter(has_text="Single sign-on did not work")
            expect(refusal).to_contain_text("none of your groups has a role here")
            assert page.url.startswith(running.url + "/signin?refused=oidc_role")
            save(page, "signin-refused-dark")
            provider.claims = {}
            button.click()  # and this one still leads back
            signed_in(page, "ada-l", "operator")
            expect(page.locator(".timebar[data-mode=past]")).to_be_visible()
            assert page.url == running.url + PLACE
