"""A headless Chromium, the built dashboard, and a fake gateway that serves it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect, sync_playwright

from tests.e2e.fake_gateway import FakeGateway
from tests.e2e.fake_world import FakeRobot

ROOT = Path(__file__).resolve().parents[2]
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
ARGUMENTS = [
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
DESK = {"width": 1440, "height": 900}
PHONE = {"width": 390, "height": 844}
expect.set_options(timeout=60_000)  # a loaded machine paints late


def save(page: Page, name: str) -> None:
    """Keep a screenshot where METAROS_SHOTS says, for people to look at."""
    folder = os.environ.get("METAROS_SHOTS")
    if folder:
        page.screenshot(path=str(Path(folder) / f"{name}.png"))


@pytest.fixture(scope="session")
def built() -> None:
    """The dashboard of the present sources, in gateway/static."""
    done = subprocess.run([sys.executable, "tools/hatch_build.py"], cwd=ROOT, capture_output=True, text=True)
    if done.returncode != 0:
        pytest.fail(done.stderr)


@pytest.fixture(scope="module")
def browser(built: None) -> Iterator[Browser]:
    """One Chromium for a module; not longer, because Playwright keeps an event loop running in this thread."""
    if CHROMIUM is None:
        if os.environ.get("CI"):
            pytest.fail("CI needs Chromium")
        pytest.skip("no Chromium on this machine (Debian: apt install chromium)")
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield chromium
        chromium.close()


@pytest.fixture
def open_page(browser: Browser) -> Iterator[Callable[..., Page]]:
    """Open an address at a size and in a colour scheme; any error on a page fails the test at its end."""
    contexts, errors = [], []

    def opened(url: str, *, size: dict[str, int] = DESK, scheme: str = "light", touch: bool = False) -> Page:
        context = browser.new_context(viewport=size, color_scheme=scheme, has_touch=touch, is_mobile=touch)
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(60_000)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(url)
        return page

    yield opened
    for context in contexts:
        context.close()
    assert errors == []


@pytest.fixture
def gateway(free_port: int) -> Iterator[FakeGateway]:
    """Three robots, the second with a low battery."""
    robots = [
        FakeRobot("sim_1", "/sim_1"),
        FakeRobot("sim_2", "/sim_2", phase=2.0, battery=0.14),
        FakeRobot("sim_3", "/sim_3", phase=4.0),
    ]
    served = FakeGateway(free_port, robots)
    served.start()
    yield served
    served.stop()
