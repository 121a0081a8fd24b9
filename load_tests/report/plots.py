"""Which plots a record gets: time series of one round, or figures over numbers of robots."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from load_tests.report.record import Record, value_of
from load_tests.report.svg import Line, growth_plot, time_plot

__all__ = ["plots"]

MIB = 2**20
# title, unit, factor, lines: name, series, colour
TIMES = (
    (
        "CPU",
        "cores",
        1.0,
        (("gateway", "gateway_cores", 1), ("simulator", "simulator_cores", 3), ("others", "foreign_cores", 2)),
    ),
    ("Links up", "robots", 1.0, (("links", "links", 3),)),
    ("Gateway's memory", "MiB resident", 1 / MIB, (("gateway", "gateway_rss", 4),)),
    ("From handed over to acknowledged", "ms", 1.0, (("p50", "ack_p50_ms", 1), ("p99", "ack_p99_ms", 2))),
    ("From a robot to a viewer", "ms", 1.0, (("p50", "view_p50_ms", 1), ("p99", "view_p99_ms", 2))),
    ("On the wire", "kB/s", 1e-3, (("from robots", "sent_bytes_per_s", 1), ("to robots", "received_bytes_per_s", 2))),
    ("Frames of the link", "a second", 1.0, (("both ways", "frames_per_s", 1),)),
)
# title, unit, lines: name, path, colour
GROWTHS = (
    ("Gateway's CPU for each robot", "us a second", (("CPU", "gateway_us_per_robot_s", 1),)),
    ("Gateway's CPU", "cores", (("measured", "gateway_cores", 1), ("fit", "fit_cores", 2))),
    ("Gateway's memory", "MiB", (("resident", "gateway_rss_mib", 4), ("fit", "fit_rss_mib", 2))),
    ("Acknowledgements and HTTP", "ms, p99", (("acks", "ack_ms.p99", 1), ("HTTP", "http_ms.p99", 2))),
    (
        "On the wire, each robot",
        "bytes a second",
        (("from robots", "sent_per_robot_bytes_per_s", 1), ("to robots", "received_per_robot_bytes_per_s", 2)),
    ),
    (
        "On disk, each robot",
        "bytes a second",
        (("all", "disk_per_robot_bytes_per_s", 3), ("database", "database_per_robot_bytes_per_s", 4)),
    ),
)


def plots(record: Record) -> Iterator[str]:
    """Of a study of growth its curves, then every round's time series."""
    if record.scenario == "growth" and len(record.rounds) > 1:
        yield from _growth(record)
    for index, figures in enumerate(record.rounds):
        name = f"{figures.get('name') or index + 1}: " if len(record.rounds) > 1 else ""
        yield from _times(figures, name, few=record.scenario in ("growth", "transports"))


def _times(figures: dict[str, Any], name: str, *, few: bool) -> Iterator[str]:
    series = figures.get("series") or {}
    marks = [(float(at), str(text)) for at, text in figures.get("marks", ())]
    for title, unit, factor, rows in TIMES[:1] if few else TIMES:
        lines = [
            Line(label, series["t"], [value * factor for value in series[key]], colour)
            for label, key, colour in rows
            if any(series.get(key, ()))
        ]
        if lines:
            yield time_plot(name + title, unit, lines, marks=marks)


def _growth(record: Record) -> Iterator[str]:
    bends = [figures["bend"] for figures in record.rounds if figures.get("bend")]
    for title, unit, rows in GROWTHS:
        lines = []
        for label, path, colour in rows:
            points = [(value_of(figures, "robots"), value_of(figures, path)) for figures in record.rounds]
            known = [(robots, value) for robots, value in points if robots and value]
            if known:
                lines.append(Line(label, [robots for robots, _ in known], [value for _, value in known], colour))
        bend = (float(bends[0]["robots"]), str(bends[0]["text"])) if bends else None
        if lines:
            yield growth_plot(title, unit, lines, bend=bend)
