"""Markup in every text that robots and people give: the dashboard shows it, and runs none of it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from gateway.domain.principal import Role
from tests.e2e.conftest import save
from tests.e2e.fake.gateway import FakeGateway, account
from tests.e2e.fake.robots import QUIET, FakeRobot
from tests.e2e.real.gateway import real_gateway

pytestmark = [pytest.mark.browser, pytest.mark.xdist_group("browser")]

OpenPage = Callable[..., Page]
IMAGE = '<img src=x onerror="window.__ran=1;alert(1)">'
SCRIPT = "<script>window.__ran=1;alert(2)</script>"
LINK = "javascript:window.__ran=1;alert(3)//"
BREAKING = '"><svg onload=alert(4)><a href="javascript:alert(5)">x</a>{{7*7}}'
NOT_INERT = """() => [
  ...document.querySelectorAll("img[onerror], svg[onload], iframe, object, embed, base, [srcdoc]"),
  ...[...document.querySelectorAll("script")].filter(node => !node.src && node.type !== "module"),
  ...[...document.querySelectorAll("*")].filter(node => [...node.attributes].some(one =>
    /^on/i.test(one.name) || (/^(href|src|action|formaction|xlink:href)$/i.test(one.name)
      && /^\\s*(javascript|data:text)/i.test(one.value)))),
].map(node => node.outerHTML.slice(0, 200))"""


class Watched:
    """A page, and what it did that it should not."""

    def __init__(self, page: Page) -> None:
        self.page, self.seen = page, list[str]()
        page.on("dialog", self._dialog)
        page.on("console", lambda said: self.seen.append(said.text) if said.type == "error" else None)
        page.on("popup", lambda _: self.seen.append("popup"))

    def _dialog(self, dialog: object) -> None:
        self.seen.append(f"dialog {dialog}")
        dialog.dismiss()  # type: ignore[attr-defined]

    def check(self, what: str) -> None:
        """Nothing ran, and nothing stands there that could."""
        assert self.page.evaluate("window.__ran") is None, what
        assert self.page.evaluate(NOT_INERT) == [], what
        assert self.seen == [], what
        save(self.page, f"injection-{what}")


class OddRobot(FakeRobot):
    """All that it says of itself is markup."""

    def topic(self, name: str) -> str:
        """Outside its namespace, so that pages show it in full."""
        return f"/{self.note}/{name}"

    def describe(self, now: str) -> dict[str, object]:
        labels = {IMAGE: LINK, "link": LINK, "site": SCRIPT, BREAKING: BREAKING}
        odd = {"hostname": IMAGE, "agent_version": SCRIPT, "labels": labels}
        link = {**self.describe_link(), "transport": SCRIPT, "gateway": LINK}
        return super().describe(now) | odd | {"link": link}


@pytest.mark.parametrize("text", [LINK, IMAGE + SCRIPT + BREAKING], ids=["link", "markup"])
def test_what_a_robot_says_is_text_on_every_page(gateway: FakeGateway, open_page: OpenPage, text: str) -> None:
    name = text.replace("/", "")  # an id is one part of a path
    odd = OddRobot(name, "/odd", note=text, told=QUIET)
    odd.gaps = 2
    gateway.robots[:] = [odd, FakeRobot("sim_2", "/sim_2")]
    gateway.account = account(Role.OPERATOR, name=text)
    page = open_page("about:blank", own=True)
    watched = Watched(page)
    page.goto(gateway.url)
    expect(page.locator(".robot-link", has_text=name).first).to_be_visible()
    watched.check("fleet")
    page.locator(".robot-link", has_text=name).first.click()
    expect(page.locator("h1")).to_have_text(name)
    card = page.locator("details[data-topic]", has_text="note").first
    card.locator("summary").click()
    expect(card.locator("dd")).to_have_text(text)
    watched.check("robot")
    for tab in ("topics", "past"):
        page.goto(f"{page.url.partition('?')[0]}?tab={tab}")
        expect(page.locator("h1")).to_have_text(name)
        if tab == "topics":
            expect(page.locator("table.topics")).to_contain_text(f"{text}/note")
        watched.check(tab)
    page.goto(f"{gateway.url}/recordings")
    expect(page.locator("main")).to_be_visible()
    watched.check("recordings")


def test_what_people_and_alarms_say_is_text_on_the_admin_pages(
    tmp_path: Path, built: None, open_page: OpenPage
) -> None:
    with real_gateway(tmp_path) as gateway:
        page = open_page("about:blank", link=gateway.link(), own=True)
        watched = Watched(page)
        alarm = {"robot": "arm_1", "state": "active", "enrolled": "2026-11-21T06:00:00Z", "certificates": []}
        odd = [alarm | {"robot": text, "alarm": text, "reason": text} for text in (IMAGE, SCRIPT, LINK, BREAKING)]

        def identities(route: object) -> None:
            known = route.fetch().json()  # type: ignore[attr-defined]
            route.fulfill(json=known | {"identities": odd})  # type: ignore[attr-defined]

        page.route("**/api/v1/identities", identities)
        page.goto(f"{gateway.url}/admin/robots")
        expect(page.locator("[data-alarm]").first).to_contain_text(IMAGE)
        for text in (IMAGE, SCRIPT, LINK, BREAKING):
            expect(page.locator(".admin")).to_contain_text(text)
        watched.check("admin-robots")
        for text in (IMAGE, SCRIPT, LINK, BREAKING):
            gateway.ask("POST", "/keys", {"name": text[:64], "role": "viewer"})
        page.goto(f"{gateway.url}/admin/keys")
        for text in (IMAGE, SCRIPT, LINK, BREAKING):
            expect(page.locator(".admin")).to_contain_text(text[:64])
        watched.check("admin-keys")
        page.goto(f"{gateway.url}/admin/audit")
        expect(page.locator("[data-row]").first).to_be_visible()
        watched.check("admin-audit")
        page.goto(f"{gateway.url}/admin/users")
        expect(page.locator("[data-user=admin]")).to_be_visible()
        watched.check("admin-users")
