"""The time bar and the recordings page on a real gateway, whose store has robots with minutes behind them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from metaros.clock import SystemClock
from tests.e2e.fake.robots import FakeRobot
from tests.e2e.history.past_hour import write_past
from tests.e2e.history.test_time_bar import LINE, PLOT, drag, stamp, wait_for_instant
from tests.e2e.real.gateway import real_stack
from tests.e2e.robot.test_robot_page import CAMERA, MAP, wait_for_data
from tests.support.processes.stack import Stack

pytestmark = [
    pytest.mark.browser,
    pytest.mark.integration,
    pytest.mark.xdist_group("browser"),
    pytest.mark.timeout(300),
]

OpenPage = Callable[..., Page]
SPAN_S = 900
LOST = (300, 420)  # seconds after the beginning


@pytest.fixture(scope="module")
def past(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Stack, FakeRobot, int]]:
    """A gateway, a robot it has stored that is away, and when its history begins."""
    folder = tmp_path_factory.mktemp("past")
    robots = [FakeRobot("sim_1", "/sim_1"), FakeRobot("sim_2", "/sim_2", phase=2.0)]
    begin_s = int(SystemClock().wall_ns() / 1e9) // 10 * 10 - SPAN_S - 60
    lost = (begin_s + LOST[0], begin_s + LOST[1])
    write_past(folder / "data", robots, begin_s, begin_s + SPAN_S, lost=lost)
    with real_stack(folder) as stack:
        yield stack, robots[0], begin_s


def test_an_instant_of_a_robot_that_is_away(past: tuple[Stack, FakeRobot, int], open_page: OpenPage) -> None:
    stack, robot, begin_s = past
    at_s = begin_s + 700
    page = open_page(f"{stack.url}/robots/sim_1?t={stamp(at_s)}&range=5m")
    wait_for_instant(page, at_s)
    data = wait_for_data(page, MAP, "d.trail > 100 && d.hits > 200 && d.poseX")
    x, y, _ = robot.pose(at_s)
    assert float(data["poseX"]) == pytest.approx(x, abs=0.01)
    assert float(data["poseY"]) == pytest.approx(y, abs=0.01)
    wait_for_data(page, CAMERA, "d.frames > 0")
    card = page.locator("details[data-topic='/sim_1/note']")
    card.locator("summary").click()
    expect(card.locator("dd")).to_have_text("all well")
    drag(page, 0.9)
    wait_for_data(page, ".timebar", f"d.t > 0 && d.t != {at_s * 1000}")


def test_a_declared_loss_is_a_gap_on_every_panel(past: tuple[Stack, FakeRobot, int], open_page: OpenPage) -> None:
    stack, _, begin_s = past
    at_s = begin_s + 360
    page = open_page(f"{stack.url}/robots/sim_1?t={stamp(at_s)}&range=15m")
    wait_for_data(page, PLOT, f"d.atMs == {at_s * 1000}")
    wait_for_data(page, ".strip", "d.gaps > 0")
    expect(page.locator("[data-card=map] [data-absent=outbox_full]")).to_contain_text("No data here")
    page.wait_for_function(f"() => ({LINE})([{PLOT!r}, 0.2, 0.9]) > 100")
    assert page.evaluate(LINE, [PLOT, 0.495, 0.525]) == 0, "no line across what is lost"


def test_an_export_of_what_is_stored(past: tuple[Stack, FakeRobot, int], open_page: OpenPage, tmp_path: Path) -> None:
    page = open_page(f"{past[0].url}/recordings")
    expect(page.locator("[data-card=storage]")).to_contain_text("of at most")
    page.get_by_role("button", name="Export MCAP").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_label("sim_2").uncheck()
    dialog.get_by_role("button", name="1 h", exact=True).click()
    with page.expect_download() as download:
        dialog.get_by_role("link", name="Download").click()
    file = tmp_path / "export.mcap"
    download.value.save_as(file)
    content = file.read_bytes()
    assert content.startswith(b"\x89MCAP0\r\n")
    assert content.endswith(b"\x89MCAP0\r\n")
    assert len(content) > 100_000
