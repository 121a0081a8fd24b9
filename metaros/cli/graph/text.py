"""A picture of the graph as a tree for people, and as a drawing for graphviz and Mermaid."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from metaros.cli.graph.model import GraphModel, Link
from metaros.cli.shared.output import counted

__all__ = ["dot", "mermaid", "summary", "tree"]

Style = Callable[[str, str], str]
BOLD, DIM, CYAN, GREEN, YELLOW, RED = "1", "2", "36", "32", "33", "31"
TAGS = {"topic": "", "service": "service ", "action": "action "}
LONELY = {"topic": "nobody publishes", "service": "nobody serves", "action": "nobody serves"}


def tree(picture: GraphModel, style: Style) -> Iterator[str]:
    """Each node, below it what it publishes and serves, below that who reads or calls; and what it awaits in vain."""
    for node in picture.nodes:
        out = [link for link in picture.links if node in link.sources]
        awaited = [link for link in picture.links if node in link.sinks and not link.sources]
        receivers = sum(link.hears(node) for link in picture.links)
        reads = style(f"   reads and calls {receivers}", DIM) if receivers and not out else ""
        yield f"{style(node, BOLD)}{reads}"
        rows = [*((link, True) for link in out), *((link, False) for link in awaited)]
        for number, (link, ours) in enumerate(rows, start=1):
            yield from _branch(node, link, style, ours=ours, last=number == len(rows))


def summary(picture: GraphModel, style: Style) -> str:
    """One line: how much there is, and whether anything is wrong."""
    counts = [len(picture.nodes)] + [sum(link.kind == kind for link in picture.links) for kind in TAGS]
    words = [counted(n, word) for n, word in zip(counts, ("node", "topic", "service", "action"), strict=True) if n]
    text = style(", ".join(words) or "nothing", DIM)
    return f"{text}  {style('✗ ' + counted(len(picture.faults), 'mismatch'), RED)}" if picture.faults else text


def _branch(node: str, link: Link, style: Style, *, ours: bool, last: bool) -> Iterator[str]:
    trunk, rail = ("└─", "  ") if last else ("├─", "│ ")
    name = f"{style(TAGS[link.kind], YELLOW)}{style(link.name, CYAN)}  {style(' or '.join(link.types), DIM)}"
    if not ours:
        yield f"{style(trunk, DIM)} {style('◁', YELLOW)} {name}  {style(LONELY[link.kind], YELLOW)}"
        return
    yield f"{style(trunk, DIM)} {name}"
    for number, sink in enumerate(link.sinks, start=1):
        elbow = "└─" if number == len(link.sinks) else "├─"
        yield f"{style(f'{rail} {elbow}', DIM)}{_end(link, node, sink, style)}"


def _end(link: Link, source: str, sink: str, style: Style) -> str:
    fault = link.fault(source, sink)
    if fault is None:
        return f"{style('▶' if link.kind == 'topic' else '◀', GREEN)} {sink}"
    return f"{style('✗', RED)} {sink}  {style(fault.text, RED)}"


def dot(picture: GraphModel) -> Iterator[str]:
    """For graphviz: `metaros graph -o dot | dot -Tsvg > graph.svg`."""
    yield "digraph metaros {"
    yield '  graph [rankdir=LR, fontname="Helvetica"];'
    yield '  node [fontname="Helvetica", fontsize=11];'
    yield '  edge [fontname="Helvetica", fontsize=9];'
    for node in picture.nodes:
        yield f"  {_quoted('node', node)} [label={_text(node)}, shape=ellipse, style=filled, fillcolor=lightblue];"
    for link in picture.links:
        shape = {"topic": "box", "service": "hexagon", "action": "octagon"}[link.kind]
        label = _text("\n".join((link.name, *link.types)))
        yield f"  {_quoted(link.kind, link.name)} [label={label}, shape={shape}];"
        yield from _edges(link)
    yield "}"


def _edges(link: Link) -> Iterator[str]:
    """Publisher to topic to subscriber, client to service to server; a fault is an edge of its own, in red."""
    middle = _quoted(link.kind, link.name)
    backwards = link.kind != "topic"
    reached = [sink for sink in link.sinks if link.hears(sink)]
    pairs = [(_quoted("node", source), middle) for source in link.sources]
    pairs += [(middle, _quoted("node", sink)) for sink in link.sinks if sink in reached or not link.sources]
    for first, second in pairs:
        yield f"  {second} -> {first};" if backwards else f"  {first} -> {second};"
    for fault in link.faults:
        ends = (_quoted("node", fault.source), _quoted("node", fault.sink))
        yield f"  {ends[0]} -> {ends[1]} [color=red, fontcolor=red, style=dashed, label={_text(fault.text)}];"


def mermaid(picture: GraphModel) -> Iterator[str]:
    """For Mermaid, which GitHub draws in Markdown: a fault is a dotted arrow with its reason."""
    shapes = {"topic": '["{}"]', "service": '{{{{"{}"}}}}', "action": '[["{}"]]'}
    ids = {f"node {node}": f"n{number}" for number, node in enumerate(picture.nodes)}
    yield "flowchart LR"
    for node in picture.nodes:
        yield f'  {ids[f"node {node}"]}(["{_entity(node)}"])'
    for number, link in enumerate(picture.links):
        middle = f"{link.kind[0]}{number}"
        label = _entity(" ".join((link.name, *link.types)))
        yield f"  {middle}{shapes[link.kind].format(label)}"
        ends = [(ids[f"node {source}"], middle) for source in link.sources]
        ends += [(middle, ids[f"node {sink}"]) for sink in link.sinks if link.hears(sink) or not link.sources]
        yield from (f"  {a} --> {b}" if link.kind == "topic" else f"  {b} --> {a}" for a, b in ends)
        for fault in link.faults:
            source, sink = ids[f"node {fault.source}"], ids[f"node {fault.sink}"]
            yield f'  {source} -. "✗ {_entity(fault.text)}" .-> {sink}'


def _entity(text: str) -> str:
    return text.replace("#", "#35;").replace('"', "#quot;")


def _quoted(kind: str, name: str) -> str:
    return _text(f"{kind} {name}")


def _text(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'
