"""The cells of the tables, for a terminal and for Markdown."""

from __future__ import annotations

import io

from rich.console import Console

from load_tests.peers.results import Cell, Results
from load_tests.peers.tables import COST, SPEED, as_markdown, as_terminal, cost_cells, speed_cells

FLOOD = {
    "rate": 1234567.8,
    "sent_rate": 1234567.8,
    "cpu_pub_us": 0.55,
    "cpu_sub_us": 1.05,
    "threads_pub": 3,
    "threads_sub": 4,
    "resident_pub": 10 << 20,
    "resident_sub": 20 << 20,
    "objects_pub": 5 << 20,
    "objects_sub": 6 << 20,
    "wire": 1.104,
}
PING = {"p50_us": 133.3, "p99_us": 174.4, "extra_bytes": 65.0}
MACHINE = {"cores": 2, "cpu": "a cpu", "python": "3.11", "zenoh": "1.10"}


def made() -> Results:
    """Two rows, one of which failed."""
    results = Results(5, 1.0, [64], MACHINE)
    results.cells[64, "zenoh"] = Cell([FLOOD], [{**PING, "others_cores": 0.6}])
    results.cells[64, "rospy"] = Cell(errors=["not installed (Debian: python3-rospy)"] * 2)
    results.many["zenoh"] = Cell([{"threads_sub": 24}])
    return results


def test_speed() -> None:
    cells = speed_cells(Cell([FLOOD], [PING]), 2469135.6)
    assert cells == ["1,234,568", "1,234,568..1,234,568", "0.50", "100%", "133", "174"]
    slow = Cell([{"rate": 19.04, "sent_rate": 90000.0}])
    assert speed_cells(slow, 1e6) == ["19.0", "19.0..19.0", "0.00002", "< 1%", "–", "–"]
    assert speed_cells(Cell(), None) == ["–"] * len(SPEED)


def test_cost() -> None:
    cells = cost_cells(Cell([FLOOD], [PING]), 64, Cell([{"threads_sub": 24}]))
    assert cells == ["0.6+1.1", "3/4", "10/20", "5/6", "1.10", "65", "24"]
    assert cost_cells(Cell(ping=[{"extra_bytes": -900.0}]), 1000, None)[-2:] == ["100 in all", ""]
    assert len(cost_cells(Cell(), 64, None)) == len(COST)


def test_terminal_shows_rows_failures_goals_and_what_disturbed() -> None:
    console = Console(width=140, record=True, file=io.StringIO())
    console.print(as_terminal(made()))
    shown = console.export_text()
    assert "1,234,568" in shown
    assert "rospy (Debian): not installed (Debian: python3-rospy)" in shown
    assert "not measured" in shown
    assert "1 of 2 runs had other processes busy" in shown


def test_markdown_has_as_many_cells_as_columns() -> None:
    lines = [line for line in as_markdown(made()).splitlines() if line.startswith("|")]
    widths = {line.count("|") for line in lines}
    assert widths == {len(SPEED) + 2, len(COST) + 2, 5}
    assert any("failed: not installed" in line for line in lines)
