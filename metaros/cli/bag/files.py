"""`metaros bag info`, `cut` and `recover`: what a recording holds, and new recordings out of it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from metaros.cli.shared.options import Format, FormatOption

__all__ = ["cut", "info", "recover"]

Bag = Annotated[Path, typer.Argument(metavar="BAG", help="An .mcap file, or a folder of them.")]
Topics = Annotated[list[str] | None, typer.Option("--topics", metavar="GLOB", help="Only these; may be repeated.")]
Compression = Annotated[str, typer.Option("--compression", metavar="zstd|lz4|none", help="Of the new file's chunks.")]


def info(
    bag: Bag,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Each publisher's account, each file.")] = False,
    output: FormatOption = Format.TEXT,
) -> None:
    """Show a recording: duration, size, topics with types, rates, gaps and QoS."""
    from metaros.cli.bag.view import bag_facts, print_bag
    from metaros.cli.shared.output import Output
    from metaros.record import open_bag

    out = Output(output)
    facts = bag_facts(open_bag(bag))
    if out.json:
        out.objects(facts)
    else:
        print_bag(out, facts, verbose=verbose)


def cut(
    bag: Bag,
    target: Annotated[Path, typer.Argument(metavar="FILE.mcap", help="The new file.")],
    topics: Topics = None,
    start: Annotated[
        float, typer.Option("--start", "-s", min=0.0, metavar="SECONDS", help="From so far into the recording.")
    ] = 0.0,
    duration: Annotated[
        float, typer.Option("--duration", "-d", min=0.0, metavar="SECONDS", help="So much; 0: to the end.")
    ] = 0.0,
    compression: Compression = "zstd",
    output: FormatOption = Format.TEXT,
) -> None:
    """Copy a piece of a recording, by time and topics, into one new file; split files become one."""
    from metaros.record import open_bag, rewrite

    done = rewrite(
        open_bag(bag),
        target,
        topics=topics or (),
        start_s=start,
        duration_s=duration or None,
        compression=compression,
    )
    _say(done, output)


def recover(
    bag: Bag,
    target: Annotated[Path, typer.Argument(metavar="FILE.mcap", help="The new file.")],
    compression: Compression = "zstd",
    output: FormatOption = Format.TEXT,
) -> None:
    """Copy what is readable of a recording that was not closed, or is damaged, into a sound one."""
    from metaros.cli.shared.output import Output
    from metaros.record import open_bag, rewrite

    out, source = Output(output), open_bag(bag)
    for file in source.files:
        if file.damage:
            out.note(f"{file.path.name}: {file.damage}")
    done = rewrite(source, target, compression=compression, damaged=out.note)
    _say(done, output)


def _say(done: object, output: Format) -> None:
    from metaros.cli.shared.output import Output, human_bytes
    from metaros.record import Rewritten

    assert isinstance(done, Rewritten)
    out = Output(output)
    span_s = (done.last_ns - done.first_ns) / 1e9
    if out.json:
        facts = {"path": str(done.path), "messages": done.messages, "size_bytes": done.size_bytes, "span_s": span_s}
        out.object_line(facts)
    else:
        out.line(f"{done.path}: {done.messages} messages, {span_s:.1f} s, {human_bytes(done.size_bytes)}")
