"""A picture of the graph as SVG: namespaces as frames, nodes, and between them what links them. Pure.

It follows the reader's light or dark setting, needs no script and no font, and its titles (what a browser shows under
the pointer) tell types, QoS and counts. Widths are counted in characters of a monospaced font.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from html import escape
from typing import TYPE_CHECKING

from metaros.cli.graph.layout import Box, Plan, Rect, Route, lay_out
from metaros.cli.graph.model import Fault, GraphModel, Link
from metaros.cli.graph.style import STYLE
from metaros.cli.shared.output import counted, human_bytes

if TYPE_CHECKING:
    from metaros.cli.shared.topic_rates import TopicRates

__all__ = ["svg"]

EM = 0.602  # of the font size: the width of a character in every common monospaced font
NAME_PX, SMALL_PX = 12.5, 10.0
NODE_HEIGHT, LINK_HEIGHT, PADDING = 34.0, 38.0, 14.0
MARGIN, HEADER = 24.0, 44.0
LONGEST = 44  # characters of a name; longer ones lose their middle
TITLE_ENDS = 12
FAULT_LINES = 24
LEGEND = (
    ("node", "node"),
    ("topic", "topic"),
    ("service", "service"),
    ("action", "action"),
    ("lonely", "no publisher or server"),
    ("fault", "does not get through"),
)
_UNPRINTABLE = re.compile(r"[^\t\n\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def svg(picture: GraphModel, rates: Mapping[str, TopicRates] | None = None, *, heading: str = "ROS graph") -> str:
    """The whole document. `rates` by topic; without them none are shown."""
    names = _namespaces(picture)
    links = {f"{link.kind} {link.name}": link for link in picture.links}
    facts = {key: _facts(link, rates) for key, link in links.items()}
    boxes = {f"node {node}": _node_box(node, picture, names) for node in picture.nodes}
    boxes |= {key: _link_box(link, facts[key], names) for key, link in links.items()}
    plan = lay_out(boxes, [arc for link in picture.links for arc in _arcs(link)])
    body = [*_frames(plan), *_edges(plan, picture)]
    for node in picture.nodes:
        body += _node(node, plan.boxes[f"node {node}"], picture, names)
    for key, link in links.items():
        body += _link(link, plan.boxes[key], facts[key], names, rates)
    return "\n".join(_page(plan, body, picture, heading)) + "\n"


def _namespaces(picture: GraphModel) -> frozenset[str]:
    """First parts of names that are some node's namespace."""
    return frozenset(f"/{node.split('/')[1]}" for node in picture.nodes if node.count("/") > 1)


def _group(name: str, names: frozenset[str]) -> str:
    first = f"/{name.split('/')[1]}" if name.count("/") > 1 else ""
    return first if first in names else ""


def _label(name: str, names: frozenset[str]) -> str:
    """A name as it is written in its frame; too long ones lose their middle."""
    group = _group(name, names)
    text = name[len(group) + 1 :] if group else name
    return text if len(text) <= LONGEST else f"{text[: LONGEST // 2 - 1]}…{text[-LONGEST // 2 :]}"


def _wide(text: str, size: float) -> float:
    return len(text) * size * EM


def _node_box(node: str, picture: GraphModel, names: frozenset[str]) -> Box:
    """Higher where many arcs end."""
    busiest = max(sum(node in getattr(link, side) for link in picture.links) for side in ("sources", "sinks"))
    height = min(max(NODE_HEIGHT, 16.0 + 5.0 * busiest), 2.5 * NODE_HEIGHT)
    return Box(round(_wide(_label(node, names), NAME_PX) + 2.6 * PADDING), height, _group(node, names))


def _link_box(link: Link, facts: tuple[str, str], names: frozenset[str]) -> Box:
    below = sum(_wide(text, SMALL_PX) for text in facts) + (PADDING * 1.5 if facts[1] else 0.0)
    width = max(_wide(_label(link.name, names), NAME_PX), below)
    return Box(round(width + 2 * PADDING), LINK_HEIGHT, _group(link.name, names))


def _facts(link: Link, rates: Mapping[str, TopicRates] | None) -> tuple[str, str]:
    """The second line of a link: its type without the middle part, and how often it comes."""
    types = " or ".join(re.sub(r"/(msg|srv|action)/", "/", name) for name in link.types)
    types = types if len(types) <= LONGEST else f"{types[: LONGEST - 1]}…"
    if not link.sources:
        return types, "nobody publishes" if link.kind == "topic" else "nobody serves"
    if link.kind != "topic" or rates is None:
        return types, ""
    rate = rates.get(link.name)
    return types, f"{rate.hz:.1f} Hz" if rate and rate.hz else "silent"


def _arcs(link: Link) -> Iterator[tuple[str, str]]:
    """What flows: samples from publisher to subscriber, requests and goals from client to server."""
    middle = f"{link.kind} {link.name}"
    tails, heads = (link.sources, link.sinks) if link.kind == "topic" else (link.sinks, link.sources)
    yield from ((f"node {tail}", middle) for tail in tails)
    yield from ((middle, f"node {head}") for head in heads if head not in tails)  # who is both has one arc, two heads


def _frames(plan: Plan) -> Iterator[str]:
    for name, at in sorted(plan.groups.items()):
        yield f'<g class="frame">{_rect(at, 12)}<text x="{at.x + 14:g}" y="{at.y + 20:g}">{_safe(name)}</text></g>'


def _edges(plan: Plan, picture: GraphModel) -> Iterator[str]:
    for link in picture.links:
        middle = f"{link.kind} {link.name}"
        bad = {fault.sink: "part" if link.hears(fault.sink) else "fault" for fault in link.faults}
        for tail, head in _arcs(link):
            node = (head if tail == middle else tail).removeprefix("node ")
            kind = bad.get(node, "") if node in link.sinks else ""
            both = ' marker-start="url(#tip)"' if node in link.sources and node in link.sinks else ""
            tip = f' marker-end="url(#tip{"-" + kind if kind else ""})"'
            yield f'<path class="arc {kind}" d="{_curve(plan.routes[tail, head])}"{tip}{both}/>'


def _curve(route: Route) -> str:
    """Level through the columns, in a bow between them."""
    parts = [f"M{route[0][0]:g} {route[0][1]:g}"]
    for number in range(1, len(route), 2):
        (x0, y0), (x1, y1) = route[number - 1], route[number]
        middle = (x0 + x1) / 2
        if number > 1:
            parts.append(f"L{x0:g} {y0:g}")
        parts.append(f"C{middle:g} {y0:g} {middle:g} {y1:g} {x1:g} {y1:g}")
    return "".join(parts)


def _node(node: str, at: Rect, picture: GraphModel, names: frozenset[str]) -> Iterator[str]:
    sends = [link for link in picture.links if node in link.sources]
    takes = [link for link in picture.links if node in link.sinks]
    lines = [node]
    for kind, gives, gets in (
        ("topic", "publishes", "reads"),
        ("service", "serves", "calls"),
        ("action", "serves", "calls"),
    ):
        for verb, links in ((gives, sends), (gets, takes)):
            if count := sum(link.kind == kind for link in links):
                lines.append(f"{verb} {counted(count, kind)}")
    text = _text(at.x + at.width / 2, at.y + at.height / 2 + 4.5, _label(node, names), "name middle")
    yield f'<g class="node">{_title(lines)}{_rect(at, NODE_HEIGHT / 2)}{text}</g>'


def _link(
    link: Link, at: Rect, facts: tuple[str, str], names: frozenset[str], rates: Mapping[str, TopicRates] | None
) -> Iterator[str]:
    lonely = "" if link.sources else " lonely"
    bar = f'<rect class="bar" x="{at.x + 1.5:g}" y="{at.y + 8:g}" width="3" height="{at.height - 16:g}" rx="1.5"/>'
    texts = _text(at.x + PADDING, at.y + 16, _label(link.name, names), "name")
    texts += _text(at.x + PADDING, at.y + 30, facts[0], "small")
    texts += _text(at.x + at.width - PADDING * 0.8, at.y + 30, facts[1], "small end fact") if facts[1] else ""
    ill = " ill" if link.faults else ""
    yield f'<g class="{link.kind}{lonely}{ill}">{_title(_about(link, rates))}{_rect(at, 7)}{bar}{texts}</g>'


def _about(link: Link, rates: Mapping[str, TopicRates] | None) -> Iterator[str]:
    yield f"{link.kind} {link.name}"
    yield " or ".join(link.types)
    if rates and (rate := rates.get(link.name)) and rate.hz:
        yield f"{rate.hz:.1f} Hz, {human_bytes(rate.bytes_per_s)}/s"
    names = ("publisher", "subscriber") if link.kind == "topic" else ("server", "client")
    yield f"{counted(len(link.sources), names[0])}, {counted(len(link.sinks), names[1])}"
    for end in link.ends[:TITLE_ENDS]:
        yield f"{end.role} {end.node}: {end.qos}"
    if len(link.ends) > TITLE_ENDS:
        yield f"and {len(link.ends) - TITLE_ENDS} more"
    yield from (_fault_line(link.name, fault) for fault in link.faults)


def _fault_line(name: str, fault: Fault) -> str:
    return f"✗ {name}: {fault.source} → {fault.sink}: {fault.text}"


def _page(plan: Plan, body: list[str], picture: GraphModel, heading: str) -> Iterator[str]:
    faults = [_fault_line(link.name, fault) for link in picture.links for fault in link.faults]
    if len(faults) > FAULT_LINES:
        faults[FAULT_LINES:] = [f"and {len(faults) - FAULT_LINES} more"]
    legend = list(_legend(picture))
    least = max([_wide(line, 11) for line in faults] + [sum(47 + 6.6 * len(words) for _, words in legend), 360.0])
    width = round(max(plan.width, least) + 2 * MARGIN)
    foot = MARGIN + HEADER + plan.height + 30
    height = round(foot + 18 * len(faults) + (8 if faults else 0) + MARGIN - 6)
    yield (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" '
        f'role="img" aria-label="{_safe(heading)}">'
    )
    yield f"<style>{STYLE}</style>"
    yield "<defs>" + "".join(_tip(kind) for kind in ("", "-fault", "-part")) + "</defs>"
    yield f'<rect class="paper" width="{width}" height="{height}" rx="16"/>'
    first, _, rest = heading.partition("\n")
    yield _text(MARGIN, MARGIN + 14, first, "heading")
    yield _text(MARGIN + len(first) * 10.6 + 14, MARGIN + 14, rest, "muted") if rest else ""
    left = round((width - 2 * MARGIN - plan.width) / 2) if plan.width < least else 0
    yield f'<g transform="translate({MARGIN + left:g} {MARGIN + HEADER:g})">'
    yield from body
    yield "</g>"
    x = MARGIN
    for kind, words in legend:
        swatch = _rect(Rect(x, foot - 9, 18, 11), 5.5 if kind == "node" else 3)
        yield f'<g class="{kind} key">{swatch}{_text(x + 25, foot, words, "muted")}</g>'
        x += 25 + len(words) * 6.6 + 22
    for number, line in enumerate(faults, start=1):
        yield _text(MARGIN, foot + 8 + 18 * number, line, "wrong")
    yield "</svg>"


def _legend(picture: GraphModel) -> Iterator[tuple[str, str]]:
    shown = {"node", *(link.kind for link in picture.links)}
    shown |= {"lonely"} if any(not link.sources for link in picture.links) else set()
    shown |= {"fault"} if picture.faults else set()
    return (row for row in LEGEND if row[0] in shown)


def _tip(kind: str) -> str:
    return (
        f'<marker id="tip{kind}" class="tip{kind}" viewBox="0 0 8 8" refX="7.5" refY="4" markerWidth="7" '
        'markerHeight="7" markerUnits="userSpaceOnUse" orient="auto-start-reverse">'
        '<path d="M0 .8 8 4 0 7.2 1.8 4Z"/></marker>'
    )


def _rect(at: Rect, radius: float) -> str:
    return f'<rect x="{at.x:g}" y="{at.y:g}" width="{at.width:g}" height="{at.height:g}" rx="{radius:g}"/>'


def _text(x: float, y: float, text: str, class_: str) -> str:
    return f'<text x="{x:g}" y="{y:g}" class="{class_}">{_safe(text)}</text>'


def _title(lines: Iterator[str] | list[str]) -> str:
    return f"<title>{_safe(chr(10).join(lines))}</title>"


def _safe(text: str) -> str:
    """For XML: escaped, and without the characters that it does not know."""
    return escape(_UNPRINTABLE.sub("\ufffd", text))
