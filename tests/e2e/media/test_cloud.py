"""The point cloud card in a real browser, drawn by software WebGL: pixels are read back from pictures of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from playwright.sync_api import Page, expect

from metaros.cdr import codec
from metaros.convert import numpy_to_points, numpy_to_quantized
from tests.e2e.conftest import PHONE, save
from tests.e2e.fake.gateway import FakeGateway
from tests.e2e.fake.history import KEPT_HZ
from tests.e2e.fake.robots import FakeRobot, FakeTopic
from tests.e2e.history.test_time_bar import at
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.browser, pytest.mark.xdist_group("browser")]

OpenPage = Callable[..., Page]
CANVAS = "[data-card=cloud] canvas"
NARROW = {"width": 520, "height": 480}  # each pixel is drawn by software
# Drawn by software; at 5 Hz the page was busy with that alone, and each of its answers took seconds.
RAW = FakeTopic("points", "sensor_msgs/msg/PointCloud2", "live", 2.0)
SMALL = FakeTopic("points/quantized", "metaros_msgs/msg/QuantizedCloud", "live", 2.0)
WITHOUT_WEBGL = """const real = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
  return kind === "webgl2" ? null : real.call(this, kind, ...more);
};"""


def room() -> npt.NDArray[np.float32]:
    """Four walls of a room, 3 m high: x, y, z, intensity."""
    along, up = np.meshgrid(np.linspace(-5, 5, 200), np.linspace(0, 3, 40))
    walls = []
    for side in (-5.0, 5.0):
        walls.append(np.stack([along, np.full_like(along, side), up, 20 * np.abs(along)], axis=-1))
        walls.append(np.stack([np.full_like(along, side), along, up, 20 * np.abs(along)], axis=-1))
    return np.concatenate([wall.reshape(-1, 4) for wall in walls]).astype(np.float32)


@dataclass
class CloudRobot(FakeRobot):
    """A fake robot with clouds, which can be bad ones."""

    kinds: tuple[FakeTopic, ...] = (RAW,)
    broken: bool = False
    copies: int = 1
    every: int = 1

    @property
    def topics(self) -> tuple[FakeTopic, ...]:
        """The clouds alone: other panels cost time."""
        return self.kinds

    def encode(self, topic: FakeTopic, at_s: float) -> bytes:
        """The CDR bytes of a topic's message, at every instant the same."""
        return small_cloud() if topic.type == SMALL.type else raw_cloud(self.copies, self.every, self.broken)


@cache
def small_cloud() -> bytes:
    """The room in few bytes."""
    return codec(SMALL.type).encode(numpy_to_quantized(room(), step_m=0.01, frame_id="roof"))


@cache
def raw_cloud(copies: int, every: int, broken: bool) -> bytes:
    """The room, several times over, or one point in so many, or with a field that lies where nothing is."""
    cloud: Any = numpy_to_points(np.tile(room(), (copies, 1))[::every], frame_id="roof")
    if broken:
        cloud.fields[0].offset = 4_000_000_000
    return codec(RAW.type).encode(cloud)


@pytest.fixture
def robot() -> CloudRobot:
    return CloudRobot("sim_1", "/sim_1")


@pytest.fixture
def gateway(fake_gateway: FakeGateway, robot: CloudRobot) -> FakeGateway:
    fake_gateway.begin([robot])
    return fake_gateway


def picture(page: Page) -> npt.NDArray[np.uint8]:
    """What the canvas shows, as rows of BGR without the tools above."""
    taken = cv2.imdecode(np.frombuffer(page.locator(CANVAS).screenshot(), np.uint8), cv2.IMREAD_COLOR)
    assert taken is not None
    return taken[60:].astype(np.uint8)


def hues(page: Page) -> set[int]:
    """The hues of its vivid pixels, in steps of 10 of 180."""
    colours = cv2.cvtColor(picture(page), cv2.COLOR_BGR2HSV).reshape(-1, 3)
    vivid = colours[(colours[:, 1] > 120) & (colours[:, 2] > 60)]
    found, counts = np.unique(vivid[:, 0] // 10, return_counts=True)
    return {int(hue) for hue, count in zip(found, counts, strict=True) if count > 30}


def drawn(page: Page, condition: str = "true") -> dict[str, str]:
    """Wait until a cloud is drawn, and until a condition of the canvas's dataset `d` holds."""
    page.locator(CANVAS).scroll_into_view_if_needed()
    page.wait_for_function(
        f"() => {{ const d = document.querySelector({CANVAS!r})?.dataset; return d && d.frames > 1 && ({condition}) }}"
    )
    found: dict[str, str] = page.evaluate(f"Object.assign({{}}, document.querySelector({CANVAS!r}).dataset)")
    return found


def test_a_cloud_is_drawn_coloured_by_height_or_otherwise_and_dark_where_dark_is_wished(
    gateway: FakeGateway, open_page: OpenPage
) -> None:
    page = open_page(f"{gateway.url}/robots/sim_1", size=NARROW)
    data = drawn(page, "d.points > 0")
    assert (data["points"], data["frame"]) == ("32000", "roof")
    assert 1000 < int(data["drawn"]) <= 32_000  # a browser that has just begun is slow
    expect(page.locator("[data-card=cloud] .note")).to_contain_text("32,000 points")
    wait_until(lambda: len(hues(page)) >= 5)
    save(page, "cloud_light")
    page.emulate_media(color_scheme="dark")
    wait_until(lambda: np.median(picture(page)) < 60 and len(hues(page)) >= 4)
    save(page, "cloud_dark")
    page.emulate_media(color_scheme="light")
    wait_until(lambda: np.median(picture(page)) > 200)
    before = picture(page)
    for name in ("Intensity", "Distance"):
        page.get_by_role("button", name=name).click()
        drawn(page, f"d.colouring === {name.lower()!r}")
        expect(page.get_by_role("button", name=name)).to_have_attribute("aria-pressed", "true")
        after = picture(page)
        assert (np.abs(after.astype(int) - before).max(axis=2) > 60).mean() > 0.02
        before = after


def test_it_is_turned_by_mouse_and_keys_and_zoomed(
    gateway: FakeGateway, robot: CloudRobot, open_page: OpenPage
) -> None:
    robot.every = 37  # so few that the slowest browser draws all of them: how far off one begins depends on them
    page = open_page(f"{gateway.url}/robots/sim_1", size=NARROW)
    at = drawn(page, "d.points > 0")
    first = picture(page)
    box = page.locator(CANVAS).bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 200, box["y"] + 200)
    page.mouse.down()
    page.mouse.move(box["x"] + 320, box["y"] + 220, steps=4)
    page.mouse.up()
    at = drawn(page, f"d.yaw !== {at['yaw']!r}")
    assert (np.abs(picture(page).astype(int) - first).max(axis=2) > 60).mean() > 0.02
    page.locator(CANVAS).focus()
    page.keyboard.press("ArrowLeft")
    drawn(page, f"d.yaw !== {at['yaw']!r}")
    page.keyboard.press("+")
    near = drawn(page, f"d.distance < {at['distance']}")
    page.mouse.move(box["x"] + 200, box["y"] + 200)
    page.mouse.wheel(0, -300)
    drawn(page, f"d.distance < {near['distance']}")
    page.get_by_role("button", name="Reset").click()
    drawn(page, f"d.distance === {at['distance']!r}")


def test_the_small_cloud_is_taken_by_itself_the_other_by_choice(
    gateway: FakeGateway, robot: CloudRobot, open_page: OpenPage
) -> None:
    robot.kinds = (RAW, SMALL)
    page = open_page(f"{gateway.url}/robots/sim_1", size=NARROW)
    assert drawn(page, "d.points > 0")["points"] == "32000"
    assert page.locator("[data-card=cloud]").get_attribute("data-topic") == "/sim_1/points/quantized"
    wait_until(lambda: len(hues(page)) >= 5)
    page.get_by_label("Cloud", exact=True).select_option("/sim_1/points")
    expect(page.locator("[data-card=cloud][data-topic='/sim_1/points']")).to_be_visible()
    drawn(page, "d.points > 0")
    wait_until(lambda: len(hues(page)) >= 5)


def test_too_many_points_are_thinned_and_that_is_said(
    gateway: FakeGateway, robot: CloudRobot, open_page: OpenPage
) -> None:
    robot.copies = 10
    page = open_page(f"{gateway.url}/robots/sim_1", size=NARROW)
    data = drawn(page, "d.points > 0")
    assert data["points"] == "320000"
    assert int(data["drawn"]) <= 200_000
    expect(page.locator("[data-card=cloud] .note")).to_contain_text("320,000 points · ")
    expect(page.locator("[data-card=cloud] .note")).to_contain_text("drawn")


def test_a_cloud_that_lies_is_said_and_a_good_one_drawn_again(
    gateway: FakeGateway, robot: CloudRobot, open_page: OpenPage
) -> None:
    robot.broken = True
    page = open_page(f"{gateway.url}/robots/sim_1", size=NARROW)
    expect(page.locator("[data-card=cloud] .problem")).to_have_text("the field x does not fit into a point")
    robot.broken = False
    drawn(page, "d.points > 0")
    expect(page.locator("[data-card=cloud] .problem")).to_have_count(0)


def test_a_lost_context_is_said_and_comes_back(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{gateway.url}/robots/sim_1", size=NARROW)
    drawn(page, "d.points > 0")
    wait_until(lambda: len(hues(page)) >= 5)
    page.evaluate(f"""() => {{
      window.lose = document.querySelector({CANVAS!r}).getContext("webgl2").getExtension("WEBGL_lose_context");
      window.lose.loseContext();
    }}""")
    expect(page.locator("[data-card=cloud] .problem")).to_contain_text("graphics card was taken away")
    page.evaluate("window.lose.restoreContext()")
    expect(page.locator("[data-card=cloud] .problem")).to_have_count(0)
    wait_until(lambda: len(hues(page)) >= 5)


def test_without_webgl_words_stand_in_its_place(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{gateway.url}/robots", size=NARROW, own=True)
    page.add_init_script(WITHOUT_WEBGL)
    page.goto(f"{gateway.url}/robots/sim_1")
    expect(page.locator("[data-card=cloud] .problem")).to_contain_text("WebGL 2 is off or missing")
    expect(page.locator("[data-card=cloud] .note")).to_contain_text("32,000 points")


def test_the_past_has_the_cloud_of_then(
    gateway: FakeGateway, open_page: OpenPage, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(KEPT_HZ, "points", 1.0)
    url, _ = at(gateway, 600)
    page = open_page(url, size=NARROW)
    assert drawn(page, "d.points > 0")["points"] == "32000"
    wait_until(lambda: len(hues(page)) >= 5)


def test_on_a_phone_it_is_as_wide_as_the_screen_and_turned_by_touch(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(f"{gateway.url}/robots/sim_1", size=PHONE, touch=True)
    data = drawn(page, "d.points > 0")
    box = page.locator(CANVAS).bounding_box()
    assert box is not None
    assert 300 < box["width"] <= PHONE["width"]
    page.evaluate(f"""() => {{
      const canvas = document.querySelector({CANVAS!r});
      canvas.setPointerCapture = () => undefined; // these pointers are not real ones
      const send = (kind, pointerId, clientX) =>
        canvas.dispatchEvent(new PointerEvent(kind, {{ pointerId, clientX, clientY: 300, bubbles: true }}));
      send("pointerdown", 11, 100);
      send("pointermove", 11, 160);
      send("pointerdown", 12, 200);
      send("pointermove", 12, 260);
      send("pointerup", 12, 260);
      send("pointerup", 11, 160);
    }}""")
    drawn(page, f"d.yaw !== {data['yaw']!r} && d.distance < {data['distance']}")
    save(page, "cloud_phone")
