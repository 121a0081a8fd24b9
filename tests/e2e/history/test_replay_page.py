"""A real robot's log, replayed through agent and gateway, on the map of its page."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Page

from tests.e2e.real.gateway import real_stack
from tests.support.data import data_set
from tests.support.waiting import wait_until

pytestmark = [
    pytest.mark.browser,
    pytest.mark.integration,
    pytest.mark.xdist_group("browser"),
    pytest.mark.timeout(600),
]

MAP = "[data-card=map] canvas"
LOG_S = 280  # at most: it ends with the test
RATE = 20

# Pixels of the map that are inked, of each kind: the live scan is accent, the path accent-2, walls neither.
INKED = """selector => {
  const canvas = document.querySelector(selector);
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  let walls = 0, path = 0;
  for (let i = 0; i < data.length; i += 4) {
    const [r, g, b, a] = data.subarray(i, i + 4);
    if (a > 150 && r > 150 && b < 80) path++;
    else if (a > 100 && Math.abs(r - b) < 60 && r > 30) walls++;
  }
  return { walls, path };
}"""


def test_page_of_the_intel_robot_shows_walls_and_path(tmp_path: Path, open_page: Callable[..., Page]) -> None:
    log = data_set("robots/intel.clf.bz2")
    with real_stack(tmp_path) as stack:
        stack.router()
        stack.agent("intel")
        wait_until(lambda: stack.online() == {"intel"}, timeout_s=60)
        page = open_page(f"{stack.url}/robots/intel")
        options = ["--rate", str(RATE), "--limit", str(LOG_S), "--zenoh-port", str(stack.zenoh_port)]
        stack.start("play", "play", str(log), "--name", "intel", *options, ready=False)
        page.wait_for_function(f"() => Number(document.querySelector({MAP!r})?.dataset.scans) > 300", timeout=60_000)
        page.get_by_role("button", name="Fit").click()
        page.wait_for_function(f"() => Number(document.querySelector({MAP!r})?.dataset.trail) > 200")
        inked = page.evaluate(INKED, MAP)
        folder = os.environ.get("METAROS_SHOTS")
        if folder:
            page.screenshot(path=str(Path(folder) / "intel.png"))
        assert inked["walls"] > 1000, inked
        assert inked["path"] > 200, inked
