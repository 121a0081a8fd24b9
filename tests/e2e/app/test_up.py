"""The whole product in a browser: `metaros up` over TLS, simulated robots, this host, pages that show and drive them.

Without TLS pages come from gateways in all other tests here, and from `metaros up` in tests/system.
"""

from __future__ import annotations

import json
import math
import os
import re
import signal
import ssl
import subprocess
import sys
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest
from playwright.sync_api import Page, expect

from tests.e2e.chromium import sign_in
from tests.e2e.conftest import PHONE, save
from tests.support.ports import free_port
from tests.support.processes.processes import END_S, end
from tests.support.waiting import wait_until

pytestmark = [
    pytest.mark.browser,
    pytest.mark.integration,
    pytest.mark.xdist_group("browser"),
    pytest.mark.timeout(600),
]

OpenPage = Callable[..., Page]
MAP = "[data-card=map] canvas"
START_MS = 200_000  # what a gateway may take to start on a loaded machine
WATCH_STREAM = """() => {
  window.states = [];
  const look = () => window.states.push(document.querySelector("[data-stream]")?.dataset.stream);
  new MutationObserver(look).observe(document.body, {subtree: true, attributeFilter: ["data-stream"]});
}"""
POSE = f"['poseX', 'poseY', 'poseYaw'].map(name => Number(document.querySelector({MAP!r}).dataset[name]))"


class Up:
    """A running `metaros up` on ports of its own."""

    def __init__(self, folder: Path) -> None:
        self.http_port, self.grpc_port, self.zenoh_port = free_port(), free_port(), free_port()
        self.url = f"https://127.0.0.1:{self.http_port}"
        command = [sys.executable, "-m", "metaros", "up", "--robots", "2", "--tls", "on"]
        command += ["--data-dir", str(folder / "data")]
        command += ["--port", str(self.http_port), "--grpc-port", str(self.grpc_port)]
        command += ["--zenoh-port", str(self.zenoh_port)]
        self.log = folder / "up.log"
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                # It keeps a key for the command line in the one, and is found through the other: by no other test.
                env={**os.environ, "HOME": str(folder), "METAROS_RUNTIME_DIR": str(folder / "run")},
            )

    def trust(self) -> ssl.SSLContext:
        """Its own root alone."""
        return ssl.create_default_context(cafile=str(self.log.parent / "data" / "gateway" / "root.pem"))

    def ask(self, path: str, body: bytes | None = None, **headers: str) -> Any:
        """What its API answers."""
        asked = urllib.request.Request(f"{self.url}/api/v1{path}", body, headers)
        with urllib.request.urlopen(asked, timeout=60, context=self.trust()) as answer:
            return json.load(answer)

    def online(self) -> int:
        """How many robots the gateway calls online; 0 while it does not answer."""
        assert self.process.poll() is None, self.log.read_text()
        try:
            robots = self.ask("/robots")["robots"]
        except OSError:
            return 0
        return sum(robot["state"] == "online" for robot in robots)

    def printed_link(self) -> str:
        """What it printed to sign in with, once."""
        found = re.search(r"Sign in\s+(https\S+/signin#\S+)", self.log.read_text())
        assert found is not None, self.log.read_text()
        return found[1]

    def link(self) -> str:
        """Another one, as `metaros signin` makes it."""
        key = (self.log.parent / "data" / "gateway" / "local.key").read_text().strip()
        headers = {"Authorization": f"Bearer {key}", "Content-Type": "application/json"}
        return str(self.ask("/auth/links", b"{}", **headers)["url"])

    def robot(self, name: str) -> dict[str, Any]:
        """A robot as the API shows it."""
        found: dict[str, Any] = self.ask(f"/robots/{name}")
        return found

    def gateway(self) -> psutil.Process:
        """The gateway's process."""
        children = psutil.Process(self.process.pid).children(recursive=True)
        return next(child for child in children if child.cmdline()[2:4] == ["metaros", "gateway"])

    def stop(self) -> None:
        """Ctrl-C, and wait."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(END_S)
        finally:
            end(self.process)


@pytest.fixture(scope="module")
def up(tmp_path_factory: pytest.TempPathFactory, built: None) -> Iterator[Up]:
    """One stack for the module, with two robots and this host online."""
    running = Up(tmp_path_factory.mktemp("up"))
    try:
        wait_until(lambda: running.online() == 3, timeout_s=START_MS / 1000, every_s=0.2)
        yield running
    finally:
        running.stop()


def come_by(link: str, page: Page, path: str) -> None:
    """By a one-time link, leaving the password for later; then to a page."""
    page.goto(link)
    page.get_by_role("button", name="Later").click()
    expect(page.locator("[data-account=admin]")).to_be_visible()
    page.goto(path)


def travelled(page: Page, seconds: float) -> float:
    """How far the robot on the map moves in so many seconds of the page's own time."""
    x, y, _ = page.evaluate(POSE)
    page.evaluate("seconds => new Promise(done => setTimeout(done, seconds * 1000))", seconds)
    to_x, to_y, _ = page.evaluate(POSE)
    return math.hypot(to_x - x, to_y - y)


def test_fleet_shows_three_robots_with_live_values(up: Up, open_page: OpenPage) -> None:
    page = open_page(up.url)
    expect(page.locator("tr[data-robot]")).to_have_count(3)
    expect(page.locator("[data-state=online], [data-state=attention]")).to_have_count(3)
    for name in ("sim_1", "sim_2"):
        expect(page.locator(f"tr[data-robot={name}] [data-label=Battery]")).to_contain_text("%")
        expect(page.locator(f"tr[data-robot={name}] [data-label=Speed]")).to_contain_text("m/s")
    host = page.locator("tr[data-robot]:not([data-robot^=sim_])")
    expect(host.locator("[data-label=CPU]")).to_contain_text("%")
    save(page, "fleet-desktop")
    phone = open_page(up.url, size=PHONE, touch=True)
    expect(phone.locator("tr[data-robot]")).to_have_count(3)
    save(phone, "fleet-phone")


def test_robot_page_shows_pose_scan_camera_and_plots(up: Up, open_page: OpenPage) -> None:
    page = open_page(f"{up.url}/robots/sim_1")
    page.wait_for_function(f"() => Number(document.querySelector({MAP!r})?.dataset.scans) > 10")
    assert int(page.locator(MAP).get_attribute("data-hits") or 0) > 100
    page.wait_for_function("() => Number(document.querySelector('[data-card=camera] canvas')?.dataset.frames) > 10")
    expect(page.locator("[data-card=plot]", has_text="Battery voltage").locator("canvas")).to_be_visible()
    expect(page.locator("[data-card=imu] canvas")).to_be_visible()
    page.wait_for_function(f"was => JSON.stringify({POSE}) !== was", arg=json.dumps(page.evaluate(POSE)))
    save(page, "robot-desktop")
    phone = open_page(f"{up.url}/robots/sim_1", size=PHONE, touch=True)
    phone.wait_for_function(f"() => Number(document.querySelector({MAP!r})?.dataset.scans) > 3")
    save(phone, "robot-phone")


def test_the_past_is_scrubbed_and_its_minute_is_saved(up: Up, open_page: OpenPage) -> None:
    at = "/robots/sim_1/at?format=json&topic=scan&max_age=5m&t=-11s"
    wait_until(lambda: up.ask(at)["messages"] != [])  # so long has it been there
    page = open_page(f"{up.url}/robots/sim_1?span=15m")
    page.wait_for_function("() => Number(document.querySelector('.strip')?.dataset.messages) > 50")
    page.get_by_role("slider", name="Instant shown").focus()
    page.keyboard.press("Shift+ArrowLeft")  # 10 s before the present
    page.wait_for_function(f"() => Number(document.querySelector({MAP!r})?.dataset.hits) > 50")
    expect(page.locator("[data-card=teleop]")).to_have_count(0)
    t_ms, before = page.locator(".timebar").get_attribute("data-t"), page.evaluate(POSE)
    page.reload()
    page.wait_for_function(f"() => Number(document.querySelector({MAP!r})?.dataset.hits) > 50")
    assert page.locator(".timebar").get_attribute("data-t") == t_ms
    assert page.evaluate(POSE) == before, "an address is an instant"
    save(page, "robot-past")
    expect(page.get_by_role("button", name="Save 60 s here")).to_have_count(0)  # this is a viewer yet
    sign_in(page, up.link())
    page.goto(f"{up.url}/recordings")
    page.get_by_label("Robot to record").select_option("sim_1")
    page.get_by_role("button", name="Save last 60 s").click()
    row = page.locator("tr[data-recording][data-state=stored]")
    expect(row).to_contain_text("sim_1")
    with page.expect_download() as download:
        row.get_by_role("link", name="Download").click()
    assert download.value.path().read_bytes().startswith(b"\x89MCAP0\r\n")
    save(page, "recordings")


def test_who_signs_in_by_the_printed_link_drives_and_letting_go_stops(up: Up, open_page: OpenPage) -> None:
    page = open_page("about:blank", own=True)
    sockets: list[str] = []
    page.on("websocket", lambda socket: sockets.append(socket.url))
    page.goto(f"{up.url}/robots/sim_2")
    expect(page.locator("[data-card=teleop]")).to_contain_text("Operators may drive.")
    expect(page.locator(".pad")).to_have_count(0)
    save(page, "up-viewer")
    come_by(up.printed_link(), page, f"{up.url}/robots/sim_2")
    assert all(cookie["secure"] for cookie in page.context.cookies())
    page.wait_for_function(f"() => Number(document.querySelector({MAP!r})?.dataset.scans) > 1")
    page.locator(".pad").focus()
    page.keyboard.down("KeyA")
    expect(page.locator("[data-teleop=holding]")).to_be_visible()
    before = page.evaluate(POSE)[2]
    page.wait_for_function(f"before => Math.abs({POSE}[2] - before) > 0.3", arg=before)
    page.keyboard.up("KeyA")
    page.wait_for_function("() => document.querySelector('.teleop').dataset.teleop !== 'holding'")
    travelled(page, 0.8)
    assert travelled(page, 0.5) < 0.02, "stands still, and autonomy has not come back"
    page.get_by_role("button", name="Resume autonomy").click()
    expect(page.locator(".resume")).to_contain_text("autonomy resumed")
    assert len(sockets) > 2, "its stream before and after, and the pad's"
    assert all(url.startswith(up.url.replace("https", "wss", 1)) for url in sockets), sockets


def test_page_and_link_recover_when_the_gateway_is_killed(up: Up, open_page: OpenPage) -> None:
    page = open_page(f"{up.url}/robots/sim_1", link=up.link())
    page.wait_for_function(f"() => Number(document.querySelector({MAP!r})?.dataset.scans) > 3")
    page.evaluate(WATCH_STREAM)  # it may be back between two looks from here
    up.gateway().kill()
    page.wait_for_function("() => states.includes('lost') && states.at(-1) === 'open'", timeout=START_MS)
    scans = int(page.locator(MAP).get_attribute("data-scans") or 0)
    # The map goes until the robot's agent is back, too, and then begins to count anew.
    more = f"scans => {{ const now = Number(document.querySelector({MAP!r})?.dataset.scans);"
    more += " return now > scans + 5 || (now > 5 && now < scans); }"
    page.wait_for_function(more, arg=scans, timeout=START_MS)
    wait_until(lambda: up.robot("sim_1")["link"]["reconnects"] >= 1, timeout_s=60, every_s=0.2)
    wait_until(lambda: up.online() == 3, timeout_s=60, every_s=0.2)
    page.get_by_role("button", name="Link").click()
    expect(page.locator("[data-card=connection] [data-transport=grpc]")).to_be_visible()
    expect(page.locator("[data-card=backfill]")).to_contain_text("Up to date")
    assert up.robot("sim_1")["counts"]["lost"] == 0
    save(page, "link-desktop")
    slider = page.get_by_label("Byte budget of the uplink")
    slider.focus()
    slider.press("Home")
    expect(page.locator("[data-limit='5000']")).to_be_visible()
    assert up.robot("sim_1")["link"]["budget_bytes_per_s"] == 5000
    slider.press("End")
    expect(page.locator("[data-limit=none]")).to_be_visible()
