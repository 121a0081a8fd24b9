"""A real driver on a pty, agent, gateway and Chromium: a lidar is unplugged and plugged in; the page says so."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.real.gateway import real_stack
from tests.support.devices.ld19_emulator import Ld19Emulator
from tests.support.devices.pty_device import PtyDevice
from tests.support.devices.serial_peer import answering
from tests.support.processes.stack import Stack
from tests.support.waiting import wait_until

pytestmark = [
    pytest.mark.browser,
    pytest.mark.integration,
    pytest.mark.xdist_group("browser"),
    pytest.mark.timeout(300),
]

OpenPage = Callable[..., Page]


@pytest.fixture
def lidar(tmp_path: Path) -> Iterator[PtyDevice]:
    """The serial line of an LD19."""
    with PtyDevice(tmp_path) as device:
        yield device


@pytest.fixture
def stack(tmp_path: Path, lidar: PtyDevice) -> Iterator[Stack]:
    """Everything between the lidar and the browser."""
    with real_stack(tmp_path) as started:
        started.router()
        started.agent("r1")
        driver = ("driver", "run", "ld19", "--param", f"port={lidar.path}", "--namespace", "/r1")
        started.start("driver", *driver, "--zenoh-port", str(started.zenoh_port))
        wait_until(lambda: "/r1/diagnostics" in started.topics("r1"), timeout_s=60)
        yield started


def stored(stack: Stack) -> int:
    """How much of the diagnostics the gateway has kept, without that anybody watched."""
    rows = stack.get("/api/v1/robots/r1/history")["topics"]
    return sum(int(row["samples"]) for row in rows if row["topic"] == "/r1/diagnostics")


@pytest.fixture
def turning(stack: Stack, lidar: PtyDevice) -> Iterator[None]:
    """It turns; and stops before the driver does, without which nobody would read the line."""
    emulator = Ld19Emulator()
    with answering(lidar, lambda _: None, lambda: emulator.turns(0.1)):
        yield


@pytest.mark.usefixtures("turning")
def test_an_unplugged_lidar_waits_works_when_it_is_back_and_its_past_is_kept(
    stack: Stack, lidar: PtyDevice, open_page: OpenPage
) -> None:
    page = open_page(f"{stack.url}/robots/r1")
    state = page.locator("[data-device='/r1/ld19'] .device-state")
    expect(state).to_have_text("working")
    expect(page.locator("[data-device='/r1/ld19'] .device-rate")).to_contain_text("Hz")
    lidar.unplug()
    expect(state).to_have_text("waiting")
    expect(page.locator("[data-card=devices] .note")).to_contain_text("1 waiting")
    lidar.replug()
    expect(state).to_have_text("working")
    wait_until(lambda: stored(stack) >= 2, timeout_s=60)
