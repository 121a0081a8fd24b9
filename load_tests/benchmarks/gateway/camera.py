"""From a camera's stamp to a picture on a canvas: JPEG 360p, JPEG 720p and H.264 720p at 30 Hz, through everything.

    python -m load_tests camera [--rounds 3] [--seconds 10] [--quick]

Real programs on the loopback: a router, the camera driver on a file of a textured pan with mild noise, the agent, the
gateway, and headless Chromium with the robot's page. The page says of each picture when it was drawn; the stamp is when
the driver had read it. CPU time is that of the agent's and of the driver's process (which also decodes the file), in
percent of a core; Mbit/s is what the driver published. Rounds are interleaved; figures are medians over the rounds.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

import cv2
import numpy as np
import psutil
from playwright.sync_api import Page, sync_playwright

import metaros
from load_tests.figures import note
from metaros.interfaces.diagnostic_msgs.msg import DiagnosticArray
from tests.e2e.chromium import ARGUMENTS, CHROMIUM, DESKTOP
from tests.support.processes.stack import Program, Stack
from tests.support.waiting import wait_until

__all__ = ["main"]

RATE_HZ: Final = 30
WARM_S: Final = 2.0
LISTEN: Final = """
window.drawn = [];
addEventListener("drawn", ({ detail }) => window.drawn.push([detail.stampMs, detail.drawnMs]));
"""


class Mode(NamedTuple):
    """What the driver publishes."""

    name: str
    output: str
    width: int
    height: int


MODES: Final = (
    Mode("JPEG 360p", "jpeg", 640, 360),
    Mode("JPEG 720p", "jpeg", 1280, 720),
    Mode("H.264 720p", "h264", 1280, 720),
)


class Figures(NamedTuple):
    """One mode in one round."""

    p50_ms: float
    p95_ms: float
    mbit_s: float
    agent_cpu: float
    driver_cpu: float
    drawn_hz: float


def write_pan(path: Path, *, frames: int = 90) -> None:
    """A textured wall that the camera pans along, with noise as a small sensor has it."""
    rng = np.random.default_rng(13)
    wall = cv2.GaussianBlur(rng.integers(0, 256, (720, 2200, 3), np.uint8), (0, 0), 3)
    wall = cv2.normalize(wall, None, 20, 235, cv2.NORM_MINMAX)  # type: ignore[call-overload]
    for _ in range(120):
        x, y = int(rng.integers(0, 2200)), int(rng.integers(0, 720))
        colour = tuple(int(value) for value in rng.integers(0, 256, 3))
        cv2.rectangle(wall, (x, y), (x + int(rng.integers(20, 200)), y + int(rng.integers(20, 150))), colour, -1)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), RATE_HZ, (1280, 720))
    for number in range(frames):
        left = round(400 * (1 + np.sin(2 * np.pi * number / frames)))
        noise = rng.normal(0, 2, (720, 1280, 1))
        writer.write(np.clip(wall[:, left : left + 1280] + noise, 0, 255).astype(np.uint8))
    writer.release()


class _Bytes:
    """What the driver says that it published."""

    def __init__(self, context: metaros.Context) -> None:
        self.total = 0
        self.node = metaros.Node("bench", context=context)
        self.node.create_subscription(DiagnosticArray, "/cam/diagnostics", self._on_status, 10)

    def _on_status(self, message: DiagnosticArray) -> None:
        found = {value.key: value.value for status in message.status for value in status.values}
        self.total = int(found.get("bytes_jpeg", 0)) + int(found.get("bytes_h264", 0))


@contextmanager
def _camera(stack: Stack, film: Path, mode: Mode) -> Iterator[Program]:
    """The driver's process."""
    settings = {"source": film, "rate": RATE_HZ, "width": mode.width, "height": mode.height, "output": mode.output}
    options = [part for name, value in settings.items() for part in ("--param", f"{name}={value}")]
    where = ("--namespace", "/cam", "--zenoh-port", str(stack.zenoh_port))
    program = stack.start("camera", "driver", "run", "camera", *options, *where)
    try:
        yield program
    finally:
        program.process.terminate()
        program.process.wait(60)
        stack.programs.remove(program)


def _cpu_s(pid: int) -> float:
    times = psutil.Process(pid).cpu_times()
    return float(times.user + times.system)


def _measure(page: Page, agent: Program, driver: Program, counted: _Bytes, seconds: float) -> Figures:
    pids = (agent.process.pid, driver.process.pid)
    page.evaluate("() => { window.drawn.length = 0; }")
    begin_s, cpu, total = time.monotonic(), [_cpu_s(pid) for pid in pids], counted.total
    page.wait_for_timeout(1000 * seconds)
    rows: list[Any] = page.evaluate("() => window.drawn.splice(0)")
    took_s = time.monotonic() - begin_s
    spent = [100 * (_cpu_s(pid) - before) / took_s for pid, before in zip(pids, cpu, strict=True)]
    latencies = sorted(drawn - stamp for stamp, drawn in rows)
    if len(latencies) < 10:
        raise SystemExit(f"only {len(latencies)} pictures were drawn in {took_s:.0f} s")
    p95 = latencies[int(0.95 * (len(latencies) - 1))]
    bits = 8 * (counted.total - total)  # told once a second: right to a few percent over ten seconds
    return Figures(statistics.median(latencies), p95, bits / took_s / 1e6, *spent, len(rows) / took_s)


def _round(stack: Stack, page: Page, film: Path, agent: Program, counted: _Bytes, seconds: float) -> dict[str, Figures]:
    found = {}
    for mode in MODES:
        with _camera(stack, film, mode) as driver:
            page.goto(f"{stack.url}/robots/cam")
            page.wait_for_function("() => window.drawn.length > 30", timeout=60_000)
            page.wait_for_timeout(1000 * WARM_S)
            found[mode.name] = _measure(page, agent, driver, counted, seconds)
    return found


def _print(rounds: Sequence[dict[str, Figures]]) -> None:
    heads = ("p50 ms", "p95 ms", "min..max p95", "Mbit/s", "agent %", "driver %", "drawn Hz")
    print(f"{'':<12}" + "".join(f"{head:>14}" for head in heads))
    for mode in MODES:
        rows = [one[mode.name] for one in rounds]
        middle = Figures(*(statistics.median(values) for values in zip(*rows, strict=True)))
        spread = f"{min(row.p95_ms for row in rows):.0f}..{max(row.p95_ms for row in rows):.0f}"
        cells = (f"{middle.p50_ms:.0f}", f"{middle.p95_ms:.0f}", spread, f"{middle.mbit_s:.1f}")
        cells += (f"{middle.agent_cpu:.0f}", f"{middle.driver_cpu:.0f}", f"{middle.drawn_hz:.1f}")
        print(f"{mode.name:<12}" + "".join(f"{cell:>14}" for cell in cells))
        note(f"{mode.name}, stamp to canvas, p95", [row.p95_ms for row in rows])
        note(f"{mode.name}, bandwidth", [row.mbit_s for row in rows])
        note(f"{mode.name}, agent", [row.agent_cpu for row in rows])


def main(argv: Sequence[str] = ()) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--rounds", type=int, default=5, help="interleaved rounds")
    parser.add_argument("--seconds", type=float, default=10.0, help="of each mode in a round")
    parser.add_argument("--quick", action="store_true", help="one short round, to see that it runs")
    options = parser.parse_args(list(argv))
    if options.quick:
        options.rounds, options.seconds = 1, 3.0
    if CHROMIUM is None:
        print("no Chromium on this machine (Debian: apt install chromium-headless-shell)")
        return 1
    with tempfile.TemporaryDirectory(prefix="metaros-camera-") as name, Stack(Path(name)) as stack:
        film = Path(name) / "pan.avi"
        write_pan(film)
        stack.router()
        stack.gateway()
        agent = stack.agent("cam")
        wait_until(lambda: "cam" in stack.online())
        with metaros.Context(connect=f"tcp/127.0.0.1:{stack.zenoh_port}") as context, sync_playwright() as playwright:
            counted = _Bytes(context)
            executor = metaros.SingleThreadedExecutor()
            executor.add_node(counted.node)
            with _spinning(executor):
                browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
                page = browser.new_page(viewport=DESKTOP)  # type: ignore[arg-type]
                page.add_init_script(LISTEN)
                rounds = [_round(stack, page, film, agent, counted, options.seconds) for _ in range(options.rounds)]
                browser.close()
    _print(rounds)
    return 0


@contextmanager
def _spinning(executor: Any) -> Iterator[None]:
    """The executor on a thread of its own."""
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    try:
        yield
    finally:
        executor.shutdown()
        thread.join(60)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
