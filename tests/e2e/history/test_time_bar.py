"""The time bar in a real browser: scrubbing what is stored, losses, playing, and addresses that reopen an instant."""

from __future__ import annotations

import datetime
import math
from collections.abc import Callable
from urllib.parse import parse_qs, urlsplit

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.conftest import PHONE
from tests.e2e.fake.gateway import FakeGateway
from tests.e2e.fake.history import iso
from tests.e2e.readable import unreadable
from tests.e2e.robot.test_robot_page import CAMERA, MAP, wait_for_data
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.browser, pytest.mark.xdist_group("browser")]

OpenPage = Callable[..., Page]
ROBOT = "/robots/sim_1"
LOOKS_AGAIN_MS = 15_000  # more than the page waits before it asks what is stored again
PLOT = "[data-card=plot][data-topic='odom.twist.twist.linear.x'] .plot"

# How many pixels of a plot's columns are drawn in the line's colour, from a part of its width to another.
LINE = """([selector, from, to]) => {
  const canvas = document.querySelector(selector + " canvas");
  const { data, width } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  let found = 0;
  for (let i = 0; i < data.length; i += 4) {
    const x = (i / 4) % width / width;
    if (x >= from && x < to && data[i + 3] > 200 && data[i] < 60 && data[i + 1] > 80 && data[i + 2] > 80) found++;
  }
  return found;
}"""


def stamp(at_s: float) -> str:
    """A whole second, as the address has it."""
    return iso(round(at_s)).replace("+00:00", "Z").replace(".000Z", "Z")


def at(gateway: FakeGateway, ago_s: float, *, more: str = "") -> tuple[str, float]:
    """The address of an instant some seconds ago, and the instant."""
    at_s = float(round(gateway.seconds() - ago_s))
    return f"{gateway.url}{ROBOT}?t={stamp(at_s)}{more}", at_s


def instant_of(page: Page) -> float:
    """The instant in the page's address, in seconds."""
    href = page.evaluate("location.href")  # page.url follows a little later
    text = parse_qs(urlsplit(href).query)["t"][0]
    return datetime.datetime.fromisoformat(text).timestamp()


def wait_for_instant(page: Page, at_s: float) -> None:
    """Until map and plots show an instant."""
    wait_for_data(page, MAP, f"d.atMs == {round(at_s * 1000)} && d.seenMs > 0")
    wait_for_data(page, PLOT, f"d.atMs == {round(at_s * 1000)}")


def drag(page: Page, part: float) -> None:
    """Take the strip at its middle and let go at a part of its width."""
    box = page.locator(".strip").bounding_box()
    assert box is not None
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + box["width"] / 2, y)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] * part, y, steps=8)
    page.mouse.up()


def test_an_address_opens_its_instant_on_every_panel(gateway: FakeGateway, open_page: OpenPage) -> None:
    url, at_s = at(gateway, 900, more="&range=5m")
    page = open_page(url)
    wait_for_instant(page, at_s)
    robot = gateway.robots[0]
    data = wait_for_data(page, MAP, "d.trail > 50 && d.poseX")
    x, y, _ = robot.pose(at_s)
    assert float(data["poseX"]) == pytest.approx(x, abs=0.01)
    assert float(data["poseY"]) == pytest.approx(y, abs=0.01)
    wait_for_data(page, CAMERA, "d.frames == 1")
    reading = page.locator("[data-card=plot]", has_text="forward").locator(".readings b").inner_text()
    rate_hz = 400 / 600  # of what is loaded: 400 points, five minutes on both sides of the instant
    last = math.floor(at_s * rate_hz)
    held_s = max(step / rate_hz for step in (last - 1, last, last + 1) if step / rate_hz <= at_s)
    speed = robot.metrics(held_s)["odom.twist.twist.linear.x"]
    assert float(reading.split("\u202f")[0]) == pytest.approx(speed, abs=0.006), "the newest point, in two digits"
    card = page.locator("details[data-topic='/sim_1/note']")
    card.locator("summary").click()
    expect(card.locator("dd")).to_have_text("all well")
    page.reload()
    wait_for_instant(page, at_s)


def test_nobody_drives_by_the_past_and_live_is_a_key_away(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(at(gateway, 600)[0])
    expect(page.locator("[data-mode=past]")).to_be_visible()
    wait_for_data(page, MAP, "d.scans > 0")
    assert page.locator("[data-card=teleop]").count() == 0
    page.keyboard.press("l")
    expect(page.locator("[data-mode=live]")).to_be_visible()
    expect(page.locator("[data-card=teleop]")).to_be_visible()
    assert "t=" not in page.evaluate("location.href")
    wait_for_data(page, MAP, "d.atMs === '' && d.scans > 5")


def test_dragging_moves_everything_and_the_address(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(gateway.url + ROBOT)
    strip = wait_for_data(page, ".strip", "d.messages > 1000")
    drag(page, 0.25)
    at_s = instant_of(page)
    span_s = (float(strip["endMs"]) - float(strip["startMs"])) / 1000
    assert at_s == pytest.approx(float(strip["startMs"]) / 1000 + span_s / 4, abs=span_s / 100 + 60)
    wait_for_instant(page, at_s)
    x, _, _ = gateway.robots[0].pose(at_s)
    assert float(wait_for_data(page, MAP, "d.poseX")["poseX"]) == pytest.approx(x, abs=0.7)
    drag(page, 0.75)
    assert instant_of(page) > at_s
    wait_for_instant(page, instant_of(page))


def test_a_loss_is_drawn_as_a_loss(gateway: FakeGateway, open_page: OpenPage) -> None:
    now_s = gateway.seconds()
    gateway.history.losses = [(now_s - 1020, now_s - 900)]
    page = open_page(at(gateway, 960, more="&range=15m")[0])
    wait_for_data(page, PLOT, "d.atMs > 0")
    wait_for_data(page, ".strip", "d.gaps == 1")
    expect(page.locator("[data-card=map] [data-absent=outbox_full]")).to_contain_text("No data here")
    expect(page.locator("[data-card=camera] [data-absent=outbox_full]")).to_contain_text("the oldest went")
    expect(page.locator("[data-card=plot]", has_text="forward").locator(".readings b")).to_have_text("–")
    assert page.evaluate(LINE, [PLOT, 0.2, 0.5]) > 100
    assert page.evaluate(LINE, [PLOT, 0.51, 0.57]) == 0, "no line across what is lost"
    assert page.evaluate(LINE, [PLOT, 0.7, 0.95]) > 100


def test_what_is_old_says_so(gateway: FakeGateway, open_page: OpenPage) -> None:
    now_s = gateway.seconds()
    at_s = float(round(now_s - 600) // 5 * 5 + 3)  # between two pictures
    gateway.history.losses = [(at_s - 25, at_s - 1)]
    page = open_page(f"{gateway.url}{ROBOT}?t={stamp(at_s)}")
    expect(page.locator("[data-card=camera] .age-stale")).to_contain_text("s before")
    gateway.history.losses = [(now_s - 4000, at_s + 100)]
    page.reload()
    expect(page.locator("[data-card=map] [data-absent]")).to_contain_text("No data here")
    assert "poseX" not in page.evaluate(f"Object.assign({{}}, document.querySelector({MAP!r}).dataset)")


def test_keys_step_and_space_plays_on(gateway: FakeGateway, open_page: OpenPage) -> None:
    url, at_s = at(gateway, 300)
    page = open_page(url)
    wait_for_instant(page, at_s)
    strip = page.get_by_role("slider", name="Instant shown")
    strip.focus()
    strip.press("ArrowLeft")
    wait_for_instant(page, at_s - 1)
    strip.press("Shift+ArrowRight")
    wait_for_instant(page, at_s + 9)
    page.get_by_role("button", name="×16").click()
    strip.focus()
    strip.press(" ")
    expect(page.get_by_role("button", name="Pause")).to_be_visible()
    wait_for_data(page, MAP, f"d.atMs > {(at_s + 20) * 1000}")
    strip.press(" ")
    wait_until(lambda: instant_of(page) > at_s + 20, timeout_s=60)
    strip.press("End")
    expect(page.locator("[data-mode=live]")).to_be_visible()


def test_without_history_it_says_so_and_shows_what_is_live(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.history.empty = True
    page = open_page(gateway.url + ROBOT)
    expect(page.locator(".strip-empty")).to_contain_text("Nothing of this robot is stored yet")
    wait_for_data(page, MAP, "d.scans > 3")


def test_a_minute_is_asked_for_and_marked(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(gateway.url + ROBOT, clock=True)
    page.get_by_role("button", name="Save last 60 s").click()
    expect(page.locator("[data-save=asked]")).to_be_visible()
    page.clock.fast_forward(LOOKS_AGAIN_MS)
    wait_for_data(page, ".strip", "d.recordings == 1")
    url, at_s = at(gateway, 200)
    page.goto(url)
    page.get_by_role("button", name="Save 60 s here").click()
    expect(page.locator("[data-save=asked]")).to_be_visible()
    newest = gateway.recordings.rows[0]
    assert datetime.datetime.fromisoformat(newest["start"]).timestamp() == at_s - 30
    gateway.recordings.refuses = "this robot has no black box"
    page.reload()
    page.get_by_role("button", name="Save 60 s here").click()
    expect(page.locator("[data-save=refused]")).to_contain_text("no black box")


def test_the_past_fits_a_phone_and_can_be_read(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.history.losses = [(gateway.seconds() - 700, gateway.seconds() - 590)]
    page = open_page(at(gateway, 600)[0], size=PHONE, touch=True)
    expect(page.locator("[data-card=map] [data-absent]")).to_be_visible()
    assert unreadable(page) == []
