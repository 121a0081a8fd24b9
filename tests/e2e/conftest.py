"""A headless Chromium, the built dashboard, and a fake gateway that serves it."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page

from tests.e2e.chromium import ARGUMENTS, CHROMIUM, DESKTOP, PHONE, Chromium, Pages
from tests.e2e.fake.gateway import FakeGateway
from tests.e2e.fake.robots import QUIET, FakeRobot
from tests.e2e.readable import save
from tests.support.ports import free_port
from tools import hatch_build

__all__ = ["ARGUMENTS", "CHROMIUM", "DESKTOP", "PHONE", "ROOT", "save"]

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def built() -> None:
    """The dashboard of the present sources, in gateway/static."""
    if hatch_build.is_fresh(ROOT):
        return
    done = subprocess.run([sys.executable, "tools/hatch_build.py"], cwd=ROOT, capture_output=True, text=True)
    if done.returncode != 0:
        pytest.fail(done.stderr)


@pytest.fixture(scope="session")
def one_chromium(built: None) -> Iterator[Chromium]:
    """This worker's Chromium."""
    if CHROMIUM is None:
        if os.environ.get("CI"):
            pytest.fail("CI needs Chromium")
        pytest.skip("no Chromium on this machine (Debian: apt install chromium-headless-shell)")
    started = Chromium()
    yield started
    started.close()


@pytest.fixture
def chromium(one_chromium: Chromium) -> Iterator[Chromium]:
    """It, for the length of a test."""
    with one_chromium.used():
        yield one_chromium


@pytest.fixture
def browser(chromium: Chromium) -> Browser:
    """The browser as Playwright has it."""
    return chromium.browser


@pytest.fixture
def open_page(chromium: Chromium, browser: Browser) -> Iterator[Callable[..., Page]]:
    """Open an address at a size and in a colour scheme; any error on a page fails the test at its end."""
    pages = Pages(chromium)
    yield pages.open
    pages.clear()
    assert pages.errors == []


@pytest.fixture(scope="session")
def fake_port() -> int:
    """The port of every fake gateway of this worker, one after another: Chromium remembers the code from there."""
    return free_port()


@pytest.fixture(scope="module")
def fake_gateway(fake_port: int, built: None) -> Iterator[FakeGateway]:
    """One for the module's tests, each of which begins it anew."""
    served = FakeGateway(fake_port, [])
    served.start()
    yield served
    served.stop()


@pytest.fixture
def gateway(fake_gateway: FakeGateway) -> FakeGateway:
    """Three robots, the second with a low battery."""
    fake_gateway.begin(
        [
            FakeRobot("sim_1", "/sim_1"),
            FakeRobot("sim_2", "/sim_2", phase=2.0, battery=0.14),
            FakeRobot("sim_3", "/sim_3", phase=4.0),
        ]
    )
    return fake_gateway


@pytest.fixture
def quiet(gateway: FakeGateway) -> None:
    """Its robots have no map and no camera, for tests that look at something else."""
    for robot in gateway.robots:
        robot.told = QUIET
