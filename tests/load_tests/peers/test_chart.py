"""The chart is well-formed, and bars are as long as they should be."""

from __future__ import annotations

from xml.etree import ElementTree

from load_tests.peers.chart import as_svg, bar_width
from load_tests.peers.results import Cell, Results


def test_bars_are_logarithmic() -> None:
    assert bar_width(100.0, 10.0, 1000.0, 300.0) == 150.0
    assert bar_width(1000.0, 10.0, 1000.0, 300.0) == 300.0


def test_one_bar_a_row_and_none_for_what_failed() -> None:
    results = Results(5, 1.0, [64, 1024], {})
    results.cells[64, "zenoh"] = Cell([{"rate": 1e6}])
    results.cells[64, "metaros-executor"] = Cell([{"rate": 4e5}])
    results.cells[64, "rospy"] = Cell(errors=["no"])
    root = ElementTree.fromstring(as_svg(results))
    bars = [each for each in root.iter() if each.tag.endswith("rect")]
    assert len(bars) == 1 + 2  # the paper, and two rows
    texts = "".join(root.itertext())
    assert "1,000,000" in texts
    assert "1 KiB" not in texts


def test_one_row_alone_and_none() -> None:
    results = Results(5, 1.0, [64], {})
    ElementTree.fromstring(as_svg(results))
    results.cells[64, "zenoh"] = Cell([{"rate": 10.0}])
    ElementTree.fromstring(as_svg(results))
