"""The recordings page in a real browser: saving, progress, failures, deleting, exporting, and storage."""

from __future__ import annotations

from collections.abc import Callable
from urllib.parse import parse_qs, urlsplit

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.conftest import PHONE
from tests.e2e.fake.gateway import FakeGateway
from tests.e2e.readable import unreadable

pytestmark = [pytest.mark.browser, pytest.mark.xdist_group("browser")]

OpenPage = Callable[..., Page]


def test_a_minute_is_saved_comes_in_and_can_be_downloaded(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(gateway.url)
    page.get_by_role("link", name="Recordings").click()
    expect(page.locator(".empty h1")).to_have_text("No recordings yet")
    page.get_by_label("Robot to record").select_option("sim_3")
    page.get_by_role("button", name="Save last 60 s").click()
    row = page.locator("tr[data-recording]")
    expect(row).to_contain_text("sim_3")
    expect(row).to_contain_text("waits for the robot")
    one = gateway.recordings.rows[0]
    one |= {"state": "transferring", "size_bytes": 4_000_000, "received_bytes": 1_000_000}
    expect(row.get_by_role("progressbar")).to_have_attribute("aria-valuenow", "25")
    one |= {"state": "stored", "received_bytes": 4_000_000, "messages": 6000}
    expect(row).to_contain_text("6,000")
    with page.expect_download() as download:
        row.get_by_role("link", name="Download").click()
    assert download.value.suggested_filename.endswith(".mcap")


def test_a_failure_says_why_and_deleting_takes_two_presses(gateway: FakeGateway, open_page: OpenPage) -> None:
    now_s = gateway.seconds()
    gateway.recordings.add("sim_2", now_s - 90, now_s - 30, "failed", code="nothing_there", message="<b>too old</b>")
    page = open_page(f"{gateway.url}/recordings")
    row = page.locator("tr[data-recording]")
    expect(row).to_contain_text("<b>too old</b>")
    row.get_by_role("button", name="Delete").click()
    assert len(gateway.recordings.rows) == 1
    row.get_by_role("button", name="Really?").click()
    expect(page.locator(".empty h1")).to_be_visible()
    assert gateway.recordings.rows == []


def test_a_recording_is_seen_on_its_robots_time_bar(gateway: FakeGateway, open_page: OpenPage) -> None:
    now_s = gateway.seconds()
    gateway.recordings.add("sim_1", now_s - 690, now_s - 630, "stored")
    page = open_page(f"{gateway.url}/recordings")
    page.get_by_role("link", name="View").click()
    expect(page.locator("h1")).to_have_text("sim_1")
    expect(page.locator("[data-mode=past]")).to_be_visible()
    shown_ms = float(page.locator(".timebar").get_attribute("data-t") or 0)
    assert shown_ms / 1000 == pytest.approx(now_s - 660, abs=1)


def test_an_export_is_chosen_and_downloaded(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{gateway.url}/recordings")
    page.get_by_role("button", name="Export MCAP").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_label("sim_2").uncheck()
    dialog.get_by_label("Topics").fill("/*/scan, /*/odom")
    dialog.get_by_role("button", name="1 h", exact=True).click()
    link = dialog.get_by_role("link", name="Download")
    query = parse_qs(urlsplit(link.get_attribute("href") or "").query)
    assert query["robot"] == ["sim_1", "sim_3"]
    assert query["topic"] == ["/*/scan", "/*/odom"]
    assert query["start"] < query["end"]
    with page.expect_download() as download:
        link.click()
    assert download.value.suggested_filename == "fake.mcap"
    page.get_by_role("button", name="Export MCAP").click()
    for robot in ("sim_1", "sim_3"):
        dialog.get_by_label(robot).uncheck()
    expect(dialog).to_contain_text("Choose a robot.")


def test_storage_names_what_is_kept_and_what_is_damaged(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.recordings.damaged = [
        {"object": "segments/sim_1/01.mcap", "robot": "sim_1", "topic": "/sim_1/scan", "start": None, "end": None}
    ]
    page = open_page(f"{gateway.url}/recordings")
    card = page.locator("[data-card=storage]")
    expect(card).to_contain_text("4.5\u202fGB")
    expect(card).to_contain_text("The disk is full in 93\u202fd.")
    expect(card.locator("[data-class=metric]")).to_contain_text("kept 30 d")
    expect(card.get_by_role("alert")).to_contain_text("segments/sim_1/01.mcap")


def test_the_page_fits_a_phone_and_can_be_read(gateway: FakeGateway, open_page: OpenPage) -> None:
    now_s = gateway.seconds()
    for state in ("requested", "cutting", "transferring", "stored", "failed"):
        gateway.recordings.add("sim_1", now_s - 90, now_s - 30, state, message="the robot's disk is full")
    page = open_page(f"{gateway.url}/recordings", size=PHONE, touch=True)
    expect(page.locator("tr[data-recording]")).to_have_count(5)
    expect(page.locator("[data-card=storage]")).to_be_visible()
    assert unreadable(page) == []
