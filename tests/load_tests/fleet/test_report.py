"""The report: its JSON, its page, and two of them compared."""

from __future__ import annotations

from html.parser import HTMLParser
from pathlib import Path
from typing import Any

from load_tests.fleet.growth import fit, point_at_bend
from load_tests.report.page import page
from load_tests.report.record import Record, changes, load, machine, save
from load_tests.report.svg import Line, linear_ticks, nice_top, time_plot


def round_of(robots: int, cores: float, *, p99_ms: float = 20.0) -> dict[str, Any]:
    """One size of a study of growth."""
    return {
        "name": f"{robots:,} robots",
        "robots": robots,
        "gateway_cores": cores,
        "gateway_us_per_robot_s": cores * 1e6 / robots,
        "gateway_rss_mib": 150 + robots * 0.2,
        "ack_ms": {"p50": 5.0, "p99": p99_ms},
        "series": {"t": [1.0, 2.0], "gateway_cores": [0.1, cores], "links": [1, robots]},
        "marks": [(1.0, "robots come & <stay>")],
    }


def record_of(*rounds: dict[str, Any]) -> Record:
    return Record("growth", "What a robot costs", "python -m load_tests fleet growth", machine(), list(rounds))


class Tags(HTMLParser):
    """What is in a page, and whether its elements are closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append(tag)
        self.attributes += attrs
        if tag not in ("meta", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append(tag)


def test_a_page_stands_alone_and_is_well_formed() -> None:
    record = record_of(round_of(10, 0.05), round_of(100, 0.1), round_of(1000, 0.6, p99_ms=900.0))
    point_at_bend(record.rounds)
    text = page(record)
    tags = Tags()
    tags.feed(text)
    assert tags.open == []
    assert {"figure", "svg", "polyline", "table", "style"} <= set(tags.seen)
    assert not {"script", "img", "link", "iframe"} & set(tags.seen)
    assert not [value for name, value in tags.attributes if name in ("src", "href")]
    assert "url(" not in text
    assert "@import" not in text
    assert "prefers-color-scheme: dark" in text
    assert "robots come &amp; &lt;stay&gt;" in text
    assert "1,000: acks p99 0.9 s" in text


def test_json_comes_back_as_it_was(tmp_path: Path) -> None:
    record = record_of(round_of(10, 0.05))
    save(record, tmp_path / "deep" / "report.json")
    again = load(tmp_path / "deep" / "report.json")
    assert again.rounds[0]["gateway_cores"] == 0.05
    assert again.machine["versions"]["grpcio"]


def test_changes_know_better_worse_and_ties() -> None:
    before = record_of(round_of(10, 0.10), round_of(100, 0.2), round_of(7, 0.2))
    after = record_of(round_of(10, 0.05), round_of(100, 0.205), round_of(1000, 0.4))
    found = {(change.round, change.figure): change for change in changes(before, after)}
    assert found["10 robots", "gateway_cores"].arrow == "better"
    assert found["10 robots", "gateway_cores"].ratio == 0.5
    assert found["100 robots", "gateway_cores"].arrow == "="
    assert not [name for name, _ in found if name in ("1,000 robots", "7 robots")]
    worse = changes(after, before)
    assert next(change for change in worse if change.figure == "gateway_cores").arrow == "worse"
    assert "▼ better" in page(after, before)
    assert "▲ worse" in page(before, after)


def test_a_fit_finds_what_is_fixed_and_what_each_costs() -> None:
    fixed, each = fit([10, 100, 1000], [0.03 + 0.0005 * robots for robots in (10, 100, 1000)])
    assert abs(fixed - 0.03) < 1e-9
    assert abs(each - 0.0005) < 1e-12


def test_the_bend_is_where_it_is_late_and_the_fit_is_of_what_came_before() -> None:
    rounds = [round_of(10, 0.04), round_of(100, 0.13), round_of(1000, 1.03), round_of(5000, 1.2, p99_ms=4000)]
    point_at_bend(rounds)
    assert [figures.get("bend", {}).get("robots") for figures in rounds] == [None, None, None, 5000]
    assert abs(rounds[3]["fit_cores"] - 5.03) < 0.01


def test_plots_have_round_axes_and_keep_peaks() -> None:
    assert nice_top(0.97) == 1.0
    assert nice_top(1230) == 1500
    assert linear_ticks(60) == [0, 10, 20, 30, 40, 50, 60]
    values = [0.0] * 2000
    values[1234] = 7.0
    plot = time_plot("t", "u", [Line("a", list(range(2000)), values)])
    assert plot.count(",") < 1000
    assert "41." in plot  # the peak's height: 7 of 8
