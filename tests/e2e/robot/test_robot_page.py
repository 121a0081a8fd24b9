"""The robot page in a real browser: what it draws, and driving."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.e2e.fake.gateway import FakeGateway
from tests.e2e.fake.robots import QUIET, TOPICS
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.browser, pytest.mark.xdist_group("browser")]

OpenPage = Callable[..., Page]
MAP = "[data-card=map] canvas"
CAMERA = "[data-card=camera] canvas"

# How many different colours a canvas shows: a blank one has one.
COLOURS = """selector => {
  const canvas = document.querySelector(selector);
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  return new Set(new Uint32Array(data.buffer)).size;
}"""


def wait_for_data(page: Page, selector: str, condition: str) -> dict[str, str]:
    """Wait until a JavaScript condition on the element's dataset `d` holds; returns the dataset."""
    page.wait_for_function(
        f"() => {{ const d = document.querySelector({selector!r})?.dataset; return d && ({condition}) }}"
    )
    found: dict[str, str] = page.evaluate(f"Object.assign({{}}, document.querySelector({selector!r}).dataset)")
    return found


def ops(gateway: FakeGateway) -> list[str]:
    """What the page has sent on the teleop socket."""
    return [said["op"] for said in gateway.teleop]


def pad_of(page: Page) -> Locator:
    """The drive pad, ready."""
    pad = page.locator(".pad")
    expect(pad).to_be_visible()
    return pad


def press_pad(page: Page, *, up: float = 0.9) -> None:
    """Hold the pad above its middle, by a part of its radius."""
    pad_of(page).scroll_into_view_if_needed()
    box = pad_of(page).bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2 * (1 - up))
    page.mouse.down()


def test_map_camera_and_any_other_type_are_drawn_and_letters_drive_nothing(
    gateway: FakeGateway, open_page: OpenPage
) -> None:
    page = open_page(f"{gateway.url}/robots/sim_1")
    data = wait_for_data(page, MAP, "d.scans > 5 && d.trail > 10")
    x, y, _ = gateway.robots[0].pose(gateway.seconds())
    assert math.hypot(float(data["poseX"]) - x, float(data["poseY"]) - y) < 0.8
    assert int(data["hits"]) > 300
    assert page.evaluate(COLOURS, MAP) > 20
    pad_of(page)
    page.locator("body").press("w")  # the pad has no focus
    wait_for_data(page, MAP, f"d.poseX !== {data['poseX']!r} && d.scans > {data['scans']} + 3")
    wait_for_data(page, CAMERA, "d.frames > 10")
    assert page.evaluate(COLOURS, CAMERA) > 100
    expect(page.locator("[data-card=camera] .note")).to_contain_text("320×240")
    card = page.locator("details[data-topic='/sim_1/note']")
    card.locator("summary").click()
    expect(card.locator("dd")).to_have_text("all well")
    assert gateway.teleop == []


@pytest.mark.usefixtures("quiet")
def test_plots_show_history_and_newest_value(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{gateway.url}/robots/sim_2")
    battery = page.locator("[data-card=plot]", has_text="charge")
    expect(battery.locator(".readings")).to_contain_text("14.0")
    expect(battery.locator("canvas")).to_be_visible()
    page.wait_for_function(f"() => ({COLOURS})('[data-card=plot] canvas') > 10")
    page.get_by_role("group", name="Time range").get_by_role("button", name="1h").click()
    assert page.url.endswith("?range=1h")


def test_topics_tab_is_in_the_address(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{gateway.url}/robots/sim_1?tab=topics")
    row = page.locator("tr[data-topic='/sim_1/scan']")
    expect(row).to_contain_text("LaserScan")
    expect(row).to_contain_text("10.0\u202fHz")


@pytest.mark.usefixtures("quiet")
def test_holding_the_pad_drives_and_releasing_stops(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{gateway.url}/robots/sim_1", clock=True)
    press_pad(page)
    wait_until(lambda: ops(gateway).count("drive") >= 5, timeout_s=60)
    page.mouse.up()
    wait_until(lambda: "stop" in ops(gateway), timeout_s=60)
    assert ops(gateway)[0] == "take"
    drives = [said for said in gateway.teleop if said["op"] == "drive"]
    assert drives[0]["linear"] == pytest.approx(0.45, abs=0.05)
    assert drives[0]["angular"] == 0
    assert [said["seq"] for said in drives] == list(range(1, len(drives) + 1))
    page.clock.fast_forward(2000)  # most of the time in which nobody holds it
    wait_until(lambda: "release" in ops(gateway), timeout_s=60)
    after = ops(gateway)
    assert "drive" not in after[after.index("stop") :], "nothing drives after the stop"
    expect(page.locator("[data-teleop=idle]")).to_be_visible()


def test_keys_drive_and_everything_that_ends_a_hold_stops(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.robots[0].told = (*QUIET, *(topic for topic in TOPICS if topic.name in ("odom", "scan")))
    page = open_page(f"{gateway.url}/robots/sim_1")
    for end in ("Escape", "blur", "hidden"):
        gateway.teleop.clear()
        pad_of(page).focus()
        page.keyboard.down("KeyW")
        page.keyboard.down("KeyA")
        wait_until(lambda: ops(gateway).count("drive") >= 3, timeout_s=60)
        last = [said for said in gateway.teleop if said["op"] == "drive"][-1]
        assert (last["linear"], last["angular"]) == (0.5, 1.0), end
        if end == "Escape":
            page.keyboard.press("Escape")
        elif end == "blur":
            page.locator("h1").evaluate("document.activeElement.blur()")
        else:
            page.evaluate("Object.defineProperty(document, 'hidden', {value: true})")
            page.evaluate("document.dispatchEvent(new Event('visibilitychange'))")
        wait_until(lambda: "stop" in ops(gateway), timeout_s=60)
        count = ops(gateway).count("drive")
        if end == "hidden":
            wait_until(lambda: "release" in ops(gateway), timeout_s=60)
        else:  # five scans take as long as five commands to drive
            scans = int(wait_for_data(page, MAP, "d.scans > 0")["scans"])
            wait_for_data(page, MAP, f"d.scans > {scans + 5}")
        assert ops(gateway).count("drive") <= count + 1, end
        page.keyboard.up("KeyW")
        page.keyboard.up("KeyA")


@pytest.mark.usefixtures("quiet")
def test_resume_calls_the_base_a_taken_lease_is_refused_by_name_and_leaving_ends_the_drive(
    gateway: FakeGateway, open_page: OpenPage
) -> None:
    page = open_page(f"{gateway.url}/robots/sim_1")
    page.get_by_role("button", name="Resume autonomy").click()
    expect(page.locator(".resume")).to_contain_text("autonomy resumed")
    assert gateway.called[0]["service"] == "/sim_1/base/resume"
    assert gateway.called[0]["type"] == "std_srvs/srv/Trigger"

    gateway.lease_holder = "ann"
    press_pad(page)
    expect(page.locator("[data-teleop=refused]")).to_contain_text("ann is driving")
    page.mouse.up()
    assert "drive" not in ops(gateway)

    gateway.lease_holder = None
    press_pad(page)
    wait_until(lambda: "drive" in ops(gateway), timeout_s=60)
    page.goto("about:blank")
    wait_until(lambda: "closed" in ops(gateway), timeout_s=60)


def test_losing_the_gateway_while_driving_ends_the_hold(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.robots[0].told = (*QUIET, *(topic for topic in TOPICS if topic.name.startswith("camera/")))
    page = open_page(f"{gateway.url}/robots/sim_1")
    press_pad(page)
    wait_until(lambda: ops(gateway).count("drive") >= 2, timeout_s=60)
    gateway.stop()
    expect(page.locator("[data-teleop=lost]")).to_be_visible()
    gateway.teleop.clear()
    gateway.start()
    expect(page.locator("[data-stream=open]")).to_be_visible()
    frames = int(wait_for_data(page, CAMERA, "d.frames > 0")["frames"])
    wait_for_data(page, CAMERA, f"d.frames > {frames + 3}")
    assert gateway.teleop == [], "a hold that was lost does not begin again by itself"
    page.mouse.up()


def test_an_unknown_robot_is_said_to_be_unknown(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{gateway.url}/robots/nobody")
    expect(page.locator("h1")).to_have_text("No robot “nobody”")
