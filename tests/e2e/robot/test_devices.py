"""The Devices card in a real browser: how each device stands, in words, colours and shapes; what counts up; silence."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.e2e.conftest import PHONE
from tests.e2e.fake.devices import Device, DeviceRobot, usual
from tests.e2e.fake.gateway import FakeGateway
from tests.e2e.history.test_time_bar import at
from tests.e2e.readable import unreadable

pytestmark = [pytest.mark.browser, pytest.mark.xdist_group("browser")]

OpenPage = Callable[..., Page]
ROBOT = "/robots/sim_1"


@pytest.fixture
def robot() -> DeviceRobot:
    """With a device of each usual sort."""
    made = DeviceRobot("sim_1", "/sim_1")
    made.devices = usual()
    return made


@pytest.fixture
def gateway(fake_gateway: FakeGateway, robot: DeviceRobot) -> FakeGateway:
    """That robot alone."""
    fake_gateway.begin([robot])
    return fake_gateway


def row_of(page: Page, name: str) -> Locator:
    """A device's row."""
    return page.locator(f"[data-device='{name}']")


def test_each_device_stands_there_with_its_state(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = open_page(gateway.url + ROBOT)
    expect(page.locator("[data-device]")).to_have_count(6)
    lidar = row_of(page, "/sim_1/ld19")
    expect(lidar.locator(".device-name")).to_have_text("ld19")
    expect(row_of(page, "/sim_1/front_camera").locator(".device-name")).to_have_text("front_cameracamera")
    expect(lidar.locator(".device-state")).to_have_text("working")
    expect(lidar.locator(".device-said")).to_have_text("/dev/ttyUSB0 at 230400 baud")
    expect(lidar.locator(".device-rate")).to_contain_text("9.97\u202fHz")
    expect(row_of(page, "/sim_1/microphone").locator(".device-state")).to_have_text("resting")
    foreign = row_of(page, "arm_controller: joint limits")
    expect(foreign.locator(".device-state")).to_have_text("ok")
    expect(page.locator("[data-card=devices] .note")).to_have_text("6 devices")


def test_an_unplugged_device_waits_on_top_and_works_again(
    gateway: FakeGateway, robot: DeviceRobot, open_page: OpenPage
) -> None:
    page = open_page(gateway.url + ROBOT)
    expect(page.locator("[data-device]")).to_have_count(6)
    gps = robot.device("gps")
    gps.state, gps.level, gps.message = "waiting", 2, "/dev/ttyACM0 is away"
    expect(page.locator("[data-device]").first).to_have_attribute("data-device", "/sim_1/gps")
    expect(row_of(page, "/sim_1/gps").locator(".device-state")).to_have_text("waiting")
    expect(row_of(page, "/sim_1/gps")).to_contain_text("/dev/ttyACM0 is away")
    expect(page.locator("[data-card=devices] .note")).to_have_text("6 devices · 1 waiting")
    gps.state, gps.level, gps.message = "working", 0, "fix 3D"
    expect(row_of(page, "/sim_1/gps").locator(".device-state")).to_have_text("working")


def test_counts_that_rise_are_marked_and_unfold(gateway: FakeGateway, robot: DeviceRobot, open_page: OpenPage) -> None:
    page = open_page(gateway.url + ROBOT)
    lidar = robot.device("ld19")
    lidar.values = {"bad_checksum": "3", "readings": "8300"}
    row = row_of(page, "/sim_1/ld19")
    row.locator("summary").click()
    expect(row.locator("dl")).to_contain_text("bad checksum3")
    expect(row.locator(".device-trouble")).to_have_count(0)
    lidar.values = {"bad_checksum": "9", "readings": "8400"}
    expect(row.locator(".device-trouble")).to_have_text("bad checksum 9 ↑")
    expect(row.locator(".rising")).to_have_count(1)


def test_a_device_that_says_nothing_is_silent(gateway: FakeGateway, robot: DeviceRobot, open_page: OpenPage) -> None:
    page = open_page(gateway.url + ROBOT, clock=True)
    imu = row_of(page, "/sim_1/imu")
    expect(imu.locator(".device-state")).to_have_text("working")
    robot.device("imu").silent = True
    page.clock.fast_forward(10_000)
    expect(imu.locator(".device-state")).to_have_text("silent")
    expect(imu).to_contain_text("said nothing for")
    robot.device("imu").silent = False
    expect(imu.locator(".device-state")).to_have_text("working")


def test_what_devices_say_is_text(gateway: FakeGateway, robot: DeviceRobot, open_page: OpenPage) -> None:
    evil = "<img src=x onerror='throw Error(\"ran\")'>"
    robot.devices = [Device(evil, evil, "working", 1, evil, evil, 1.0, {evil: evil, "__proto__": "1"})]
    page = open_page(gateway.url + ROBOT)
    expect(page.locator("[data-device]")).to_have_count(1)
    page.locator("[data-device] summary").click()
    expect(page.locator("[data-card=devices] dl")).to_contain_text(evil)
    expect(page.locator("[data-card=devices] img")).to_have_count(0)


def test_the_past_has_the_state_of_then(gateway: FakeGateway, open_page: OpenPage) -> None:
    url, _ = at(gateway, 600)
    page = open_page(url)
    expect(row_of(page, "/sim_1/ld19").locator(".device-state")).to_have_text("waiting")
    expect(page.locator("[data-device]")).to_have_count(1)


def test_it_is_readable(gateway: FakeGateway, robot: DeviceRobot, open_page: OpenPage) -> None:
    robot.device("gps").state, robot.device("gps").message = "waiting", "no such device: /dev/ttyACM0"
    robot.device("ld19").level, robot.device("ld19").message = 1, "the motor is slow: 5.1 of 10 turns a second"
    page = open_page(gateway.url + ROBOT)
    expect(page.locator("[data-device]")).to_have_count(6)
    page.locator("[data-device] summary").first.click()
    page.locator("[data-card=devices]").scroll_into_view_if_needed()
    faults = unreadable(page, "desktop", shot="devices-desktop")
    page.set_viewport_size(PHONE)  # type: ignore[arg-type]
    page.locator("[data-card=devices]").scroll_into_view_if_needed()
    assert faults + unreadable(page, "phone", shot="devices-phone") == []
