"""A camera's H.264 in a real browser: drawn by WebCodecs; what gets lost, broken or resized; and where it cannot be."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.chromium import INSECURE_HOST
from tests.e2e.fake.gateway import FakeGateway
from tests.e2e.fake.video import VideoRobot
from tests.e2e.history.test_time_bar import at, wait_for_instant
from tests.e2e.robot.test_robot_page import CAMERA, COLOURS, wait_for_data
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.browser, pytest.mark.xdist_group("browser")]

OpenPage = Callable[..., Page]
ROBOT = "/robots/sim_1"
NOTE = "[data-card=camera] .note"
LISTEN = """() => {
  window.drawn = [];
  addEventListener("drawn", ({ detail }) => window.drawn.push(detail));
}"""


@pytest.fixture
def robot() -> VideoRobot:
    """With JPEG and H.264 of one camera."""
    return VideoRobot("sim_1", "/sim_1")


@pytest.fixture
def gateway(fake_gateway: FakeGateway, robot: VideoRobot) -> FakeGateway:
    """That robot alone."""
    fake_gateway.begin([robot])
    return fake_gateway


def frames(page: Page) -> int:
    """How many pictures were drawn."""
    return int(page.locator(CAMERA).get_attribute("data-frames") or 0)


def asks(page: Page) -> int:
    """How often this picture has asked for a key frame: a page on a busy machine may fall behind, and asks then."""
    return int(page.locator("[data-card=camera] .camera").get_attribute("data-asks") or 0)


def joins_begun(robot: VideoRobot, page: Page, begun: int) -> None:
    """The robot heard of so many beginnings, and of each key frame that the page asked for; of nobody else."""
    wait_until(lambda: robot.joins == begun + asks(page), timeout_s=60)


def watch(gateway: FakeGateway, open_page: OpenPage) -> Page:
    """The robot's page, with its video running."""
    page = open_page(gateway.url + ROBOT)
    page.evaluate(LISTEN)
    wait_for_data(page, CAMERA, "d.frames > 5")
    page.wait_for_function("window.drawn.length > 0")
    return page


def wait_for_more(page: Page) -> None:
    """New pictures come."""
    wait_for_data(page, CAMERA, f"d.frames > {frames(page) + 5}")


def test_video_is_shown_with_its_numbers_announced_and_can_be_pictures_instead(
    gateway: FakeGateway, robot: VideoRobot, open_page: OpenPage
) -> None:
    page = watch(gateway, open_page)
    expect(page.locator("[data-card=camera]")).to_have_count(1)
    expect(page.locator("[data-card=camera] h2")).to_have_text("camera")
    assert page.evaluate(COLOURS, CAMERA) > 500
    for words in ("640×360", "Hz", "bit/s", "\u202fms"):
        expect(page.locator(NOTE)).to_contain_text(words)
    drawn = page.evaluate("window.drawn.at(-1)")
    assert {key: drawn[key] for key in ("topic", "codec", "width", "height")} == {
        "topic": "/sim_1/camera/video",
        "codec": "h264",
        "width": 640,
        "height": 360,
    }
    assert 0 < drawn["drawnMs"] - drawn["stampMs"] < 60_000
    joins_begun(robot, page, 1)

    choice = page.get_by_role("group", name="camera: shown as")
    expect(choice.get_by_role("button", name="H.264")).to_have_attribute("aria-pressed", "true")
    asked = asks(page)
    choice.get_by_role("button", name="JPEG").click()
    expect(page.locator(NOTE)).to_contain_text("320×240")
    choice.get_by_role("button", name="H.264").click()
    expect(page.locator(NOTE)).to_contain_text("640×360")
    joins_begun(robot, page, 2 + asked)


def test_after_lost_and_unreadable_frames_and_another_size_the_picture_goes_on(
    gateway: FakeGateway, robot: VideoRobot, open_page: OpenPage
) -> None:
    page = watch(gateway, open_page)
    asked = asks(page)
    robot.lose = 2
    wait_until(lambda: asks(page) > asked, timeout_s=60)
    wait_for_more(page)
    joins_begun(robot, page, 1)
    assert page.evaluate(COLOURS, CAMERA) > 500
    expect(page.locator("[data-card=camera] .problem")).to_have_count(0)

    joins = robot.joins
    robot.spoil = 5
    wait_until(lambda: robot.joins > joins, timeout_s=60)
    wait_for_more(page)
    expect(page.locator("[data-card=camera] .problem")).to_have_count(0)

    robot.size = (320, 180)
    expect(page.locator(NOTE)).to_contain_text("320×180")
    wait_for_more(page)
    assert page.locator(CAMERA).evaluate("canvas => [canvas.width, canvas.height]") == [320, 180]
    joins_begun(robot, page, 1)


def test_a_gateway_that_comes_back(gateway: FakeGateway, robot: VideoRobot, open_page: OpenPage) -> None:
    page = watch(gateway, open_page)
    gateway.stop()
    gateway.start()
    wait_until(lambda: robot.joins >= 2, timeout_s=60)
    wait_for_more(page)


def test_a_hidden_page_asks_for_no_video(gateway: FakeGateway, robot: VideoRobot, open_page: OpenPage) -> None:
    page = watch(gateway, open_page)
    hide = (
        "hidden => { Object.defineProperty(document, 'hidden', { value: hidden, configurable: true });"
        "document.dispatchEvent(new Event('visibilitychange')); }"
    )
    page.evaluate(hide, True)
    wait_until(lambda: "/sim_1/camera/video" not in gateway.watched, timeout_s=60)
    page.evaluate(hide, False)
    wait_until(lambda: robot.joins >= 2, timeout_s=60)
    wait_for_more(page)


def test_another_codec_is_named(gateway: FakeGateway, robot: VideoRobot, open_page: OpenPage) -> None:
    robot.format = "vp9"
    page = open_page(gateway.url + ROBOT)
    expect(page.locator("[data-card=camera] .problem")).to_contain_text("Video in vp9 is not shown, only h264.")


@pytest.mark.parametrize("pictures", [True, False], ids=["with JPEG", "video alone"])
def test_a_page_that_is_not_secure_says_so(
    gateway: FakeGateway, robot: VideoRobot, open_page: OpenPage, pictures: bool
) -> None:
    robot.pictures = pictures
    page = open_page(f"http://{INSECURE_HOST}:{gateway.port}{ROBOT}")
    expect(page.locator("[data-card=camera] .video-why")).to_contain_text("this page came by http")
    if pictures:
        wait_for_data(page, CAMERA, "d.frames > 3")
        expect(page.locator(NOTE)).to_contain_text("320×240")
    else:
        expect(page.locator("[data-card=camera] canvas")).to_have_count(0)
    assert robot.joins == 0


def test_a_browser_without_webcodecs_shows_the_pictures(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page("about:blank", own=True)
    page.add_init_script("delete window.VideoDecoder")
    page.goto(gateway.url + ROBOT)
    expect(page.locator("[data-card=camera] .video-why")).to_contain_text("no WebCodecs")
    wait_for_data(page, CAMERA, "d.frames > 3")


def test_the_past_shows_key_frames_and_says_where_one_is_missing(
    gateway: FakeGateway, robot: VideoRobot, open_page: OpenPage
) -> None:
    robot.pictures = False
    url, at_s = at(gateway, 600)
    page = open_page(url)
    wait_for_instant(page, at_s)
    wait_for_data(page, CAMERA, "d.frames > 0")
    expect(page.locator("[data-card=camera] .video-why")).to_have_count(0)
    robot.only_deltas = True
    url, _ = at(gateway, 900)
    page.goto(url)
    expect(page.locator("[data-card=camera] .video-why")).to_contain_text("key frame")
