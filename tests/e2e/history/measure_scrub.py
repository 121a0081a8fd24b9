"""How long scrubbing an hour of three robots takes, on a real gateway in Chromium.

    python -m tests.e2e.history.measure_scrub

Prints the time from the release of the cursor to the frame in which plots and scan of the new instant are painted.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, sync_playwright

from metaros.clock import SystemClock
from tests.e2e.conftest import ARGUMENTS, CHROMIUM, ROOT
from tests.e2e.fake.robots import FakeRobot
from tests.e2e.history.past_hour import write_past
from tests.support.processes.stack import Stack

HOUR_S = 3600
SIZE = {"width": 1280, "height": 900}

# Takes the cursor along the strip to a part of its width, lets go, and says after how many ms all is painted.
RELEASE = """part => new Promise((done, fail) => {
  const strip = document.querySelector(".strip");
  const box = strip.getBoundingClientRect();
  const y = box.top + box.height / 2;
  const fire = (type, at) => strip.dispatchEvent(new PointerEvent(type, {
    bubbles: true, pointerId: 1, button: 0, buttons: 1, clientX: box.left + box.width * at, clientY: y }));
  strip.setPointerCapture = () => {};
  const from = Number(strip.dataset.at ?? 0.5);
  fire("pointerdown", from);
  let step = 0;
  const drag = () => {
    step += 1;
    if (step < 12) { fire("pointermove", from + (part - from) * step / 12); requestAnimationFrame(drag); return; }
    const began = performance.now();
    fire("pointerup", part);
    strip.dataset.at = part;
    const look = () => {
      const t = document.querySelector(".timebar").dataset.t;
      const map = document.querySelector("[data-card=map] canvas").dataset;
      const plots = [...document.querySelectorAll("[data-card=plot] .plot")].slice(0, 3);
      const placed = map.seenMs !== "" || document.querySelector("[data-card=map] .absent");
      const shown = map.atMs === t && placed && plots.every(plot => plot.dataset.atMs === t);
      if (shown) requestAnimationFrame(() => done(performance.now() - began));
      else if (performance.now() - began > 10000) fail(JSON.stringify([t, { ...map }]));
      else requestAnimationFrame(look);
    };
    look();
  };
  drag();
})"""


def releases(page: Page, count: int) -> list[float]:
    """Milliseconds of so many releases at parts of the strip that jump about."""
    parts = [0.05 + 0.85 * ((i * 0.381966) % 1) for i in range(count)]
    return [float(page.evaluate(RELEASE, part)) for part in parts]


def said(name: str, values: list[float]) -> str:
    """A line of figures."""
    p50, p95 = np.percentile(values, [50, 95])
    return f"{name:<22} n={len(values):<4} p50 {p50:6.0f} ms   p95 {p95:6.0f} ms   worst {max(values):6.0f} ms"


def main() -> None:
    """Fill a store, serve it, scrub it."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seconds", type=int, default=HOUR_S)
    chosen = parser.parse_args()
    subprocess.run([sys.executable, "tools/hatch_build.py"], cwd=ROOT, check=True, capture_output=True)
    robots = [FakeRobot(f"sim_{i}", f"/sim_{i}", phase=2.0 * i) for i in (1, 2, 3)]
    end_s = int(SystemClock().wall_ns() / 1e9) // 10 * 10
    with tempfile.TemporaryDirectory() as folder, Stack(Path(folder)) as stack:
        write_past(Path(folder) / "data", robots, end_s - chosen.seconds, end_s)
        print(f"{chosen.seconds} s of {len(robots)} robots are stored", flush=True)
        stack.gateway()
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
            for robot in robots:
                page = browser.new_page(viewport=SIZE)
                page.goto(f"{stack.url}/robots/{robot.id}?t=-&range=15m")
                page.wait_for_function("() => Number(document.querySelector('.strip')?.dataset.messages) > 0")
                releases(page, 5)
                print(said(robot.id, releases(page, chosen.count)), flush=True)
                page.close()
            browser.close()


if __name__ == "__main__":
    main()
