"""The report as one page of HTML: no script, nothing fetched, light and dark, readable on a phone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from typing import Any

from load_tests.report.plots import plots
from load_tests.report.record import Change, Record, changes, name_of

__all__ = ["page"]

STYLE = (Path(__file__).parent / "page.css").read_text()
LEFT_OUT = frozenset({"series", "marks", "problems", "name", "goals", "span_s"})


def page(record: Record, before: Record | None = None) -> str:
    """The whole page; with an earlier report also what changed."""
    rounds = [part for index, figures in enumerate(record.rounds) for part in _round(figures, index, record)]
    parts = [
        "<!doctype html>",
        '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(record.title)}</title><style>{STYLE}</style></head><body><main>",
        f"<header><p class=over>Meta-ROS load test · {escape(record.scenario)}</p><h1>{escape(record.title)}</h1>",
        f"<p><code>{escape(record.command)}</code></p>{_machine(record.machine)}</header>",
        '<p class="warn">Interrupted: only what was measured until then is here.</p>' if record.interrupted else "",
        *(f"<p>{escape(note)}</p>" for note in record.notes),
        *plots(record),
        *rounds,
        _compared(changes(before, record), before) if before is not None else "",
        "<footer>Figures belong to the machine and to what else ran there: see foreign cores, load average.</footer>",
        "</main></body></html>",
    ]
    return "\n".join(part for part in parts if part)


def _machine(facts: dict[str, Any]) -> str:
    at = datetime.fromtimestamp(facts["at"], UTC).strftime("%Y-%m-%d %H:%M UTC")
    load = "/".join(f"{value:.1f}" for value in facts["load_average_before"])
    versions = ", ".join(f"{name} {version}" for name, version in facts["versions"].items())
    rows = {
        "when": at,
        "machine": f"{facts['cpu']}, {facts['cores']} cores, {facts['memory_gib']} GiB, {facts['system']}",
        "load average before": load,
        "commit": facts["commit"],
        "versions": f"Python {facts['python']}, {versions}",
    }
    items = "".join(f"<dt>{escape(name)}</dt><dd>{escape(str(value))}</dd>" for name, value in rows.items())
    head = f"<summary>{escape(at)}, {facts['cores']} cores, load {escape(load)}</summary>"
    return f"<details>{head}<dl>{items}</dl></details>"


def _round(figures: dict[str, Any], index: int, record: Record) -> Iterator[str]:
    name = name_of(figures, index) if len(record.rounds) > 1 or figures.get("name") else "Figures"
    yield f"<section><h2>{escape(name)}</h2>"
    if goals := figures.get("goals"):
        yield '<ul class="goals">' + "".join(_goal(goal) for goal in goals) + "</ul>"
    rows = "".join(
        f"<tr><th>{escape(path.replace('_', ' '))}</th><td>{escape(value)}</td></tr>" for path, value in _flat(figures)
    )
    yield f"<div class=wide><table>{rows}</table></div>"
    if problems := figures.get("problems"):
        yield '<ul class="warn">' + "".join(f"<li>{escape(str(problem))}</li>" for problem in problems) + "</ul>"
    yield "</section>"


def _goal(goal: dict[str, Any]) -> str:
    kind = "met" if goal["met"] else "missed"
    return f'<li class="{kind}"><b>{kind}</b> {escape(goal["text"])}</li>'


def _flat(figures: dict[str, Any]) -> Iterator[tuple[str, str]]:
    for name, value in figures.items():
        if name in LEFT_OUT:
            continue
        if isinstance(value, dict):
            yield name, ", ".join(f"{key} {number(found)}" for key, found in value.items()) or "none"
        elif isinstance(value, list):
            yield name, ", ".join(map(number, value)) or "none"
        else:
            yield name, number(value)


def number(value: Any) -> str:
    """A figure for people."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}" if abs(value) < 10 else f"{value:.1f}"
    return f"{value:,}" if isinstance(value, int) else str(value)


def _compared(found: Sequence[Change], before: Record | None) -> str:
    if before is None or not found:
        return "<section><h2>Compared</h2><p>The two reports have no figure in common.</p></section>"
    at = datetime.fromtimestamp(before.machine["at"], UTC).strftime("%Y-%m-%d %H:%M UTC")
    arrows = {"better": "▼ better", "worse": "▲ worse", "=": "= tie"}
    rows = "".join(
        f"<tr><th>{escape(change.round)}: {escape(change.figure.replace('_', ' '))}</th>"
        f"<td>{number(change.before)}</td>"
        f"<td>{number(change.after)} {escape(change.unit)}</td><td>{change.ratio:.2f}</td>"
        f'<td class="{change.arrow.strip("=") or "tie"}">{arrows[change.arrow]}</td></tr>'
        for change in found
    )
    head = "<tr><th>figure</th><th>then</th><th>now</th><th>ratio</th><th></th></tr>"
    return (
        f"<section><h2>Compared with {escape(at)} ({escape(before.machine['commit'])})</h2>"
        f"<p>Within 10 % is a tie.</p><div class=wide><table class=compare>{head}{rows}</table></div></section>"
    )
