"""The Functions and Rules pages over a real gateway: dropped code runs, a rule calls it, what fails is redriven."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.automation.test_functions import zip_of
from tests.e2e.real.gateway import real_gateway

pytestmark = [
    pytest.mark.browser,
    pytest.mark.integration,
    pytest.mark.xdist_group("browser"),
    pytest.mark.timeout(300),
]

GREET = """
def handler(event, context):
    print("greeting", event["detail"]["who"])
    if event["detail"]["who"] == "nobody":
        raise ValueError("nobody is there")
    return {"greeted": event["detail"]["who"]}
"""


def deploy(page: Page) -> None:
    """Drop the function's zip on the page."""
    page.locator(".fn-filters").get_by_role("button", name="Deploy…").click()
    dialog = page.get_by_role("dialog")
    chosen = {"name": "greet.zip", "mimeType": "application/zip", "buffer": zip_of(GREET)}
    dialog.get_by_label("Zip file").set_input_files(files=[chosen])  # type: ignore[list-item]
    dialog.get_by_role("button", name="Deploy").click()
    expect(page.locator("h1")).to_have_text("greet")


def test_code_is_deployed_called_by_a_rule_and_seen(tmp_path: Path, open_page: Callable[..., Page]) -> None:
    with real_gateway(tmp_path) as gateway:
        page = open_page(f"{gateway.url}/functions", link=gateway.link())
        deploy(page)
        event = page.get_by_label("Event as JSON")
        event.fill('{"detail": {"who": "ada"}}')
        page.get_by_role("button", name="Call it").click()
        expect(page.locator("[data-answer=ok]")).to_be_visible()
        expect(page.locator(".fn-out")).to_contain_text('"greeted": "ada"')
        expect(page.locator(".fn-answer .fn-log")).to_contain_text("greeting ada")
        page.get_by_role("button", name="Code").click()
        expect(page.locator("[data-file='handler.py']")).to_contain_text("def handler")

        page.goto(f"{gateway.url}/rules?show=new")
        page.get_by_label("Name").fill("arrivals")
        page.get_by_label("What happens").fill("lab.arrival")
        page.get_by_label("Pattern").fill('{"detail-type": ["lab.arrival"]}')
        page.get_by_label("Add a target").select_option("function")
        page.get_by_label("Function", exact=True).fill("greet")
        expect(page.locator("[data-faults='0']")).to_be_visible()
        page.get_by_role("button", name="Make it").click()
        expect(page.locator("h1")).to_have_text("arrivals")

        page.goto(f"{gateway.url}/functions/greet?tab=log")
        expect(page.locator("[data-live=true]")).to_be_visible()
        gateway.ask("POST", "/happenings", {"entries": [{"type": "lab.arrival", "detail": {"who": "bo"}}]})
        expect(page.locator(".fn-tail")).to_contain_text("greeting bo")
        page.get_by_role("button", name="Invocations").click()
        expect(page.locator("[data-call][data-status=ok]")).to_have_count(2)
        page.get_by_role("button", name="Overview").click()
        expect(page.locator("[data-trigger=rule]")).to_contain_text("arrivals")

        page.goto(f"{gateway.url}/rules/arrivals?tab=try")
        page.locator(".rule-run").click()
        expect(page.locator("[data-dry='1']")).to_contain_text("would have fired once")
        page.locator("[data-firing] summary").click()
        expect(page.locator("[data-firing] .fn-log")).to_contain_text('"who": "bo"')


def test_what_cannot_be_delivered_waits_and_is_delivered_again(tmp_path: Path, open_page: Callable[..., Page]) -> None:
    with real_gateway(tmp_path) as gateway:
        page = open_page(f"{gateway.url}/functions", link=gateway.link())
        deploy(page)
        gateway.ask("PUT", "/functions/greet", {"event_invoke": {"most_retries": 0}})
        page.get_by_label("Event as JSON").fill('{"detail": {"who": "nobody"}}')
        page.get_by_role("button", name="As an event").click()
        expect(page.locator("[data-answer], .fn-answer .badge")).to_have_text("accepted")
        page.goto(f"{gateway.url}/functions/greet?tab=dead")
        letter = page.locator("[data-dead]")
        expect(letter).to_contain_text("nobody is there")
        letter.locator(".audit-what").click()
        expect(letter.locator(".fn-log")).to_contain_text('"who": "nobody"')
        page.get_by_role("button", name="Redrive all…").click()
        page.get_by_role("dialog").get_by_role("button", name="Deliver again").click()
        expect(page.get_by_text("1 dead letter on its way again.")).to_be_visible()
        expect(letter).to_contain_text("1× redriven")  # it failed once more
        page.goto(f"{gateway.url}/functions?show=runtime")
        expect(page.locator("[data-here=true]")).to_be_visible()
        expect(page.locator("[data-pool=greet]")).to_be_visible()
