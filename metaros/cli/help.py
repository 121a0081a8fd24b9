"""The page of `metaros --help`, written by hand: it loads no noun and no rich, and is there at once."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator

from metaros.cli.nouns import Noun

__all__ = ["help_page"]

OPTIONS = (
    ("--version", "Show the version"),
    ("--ca FILE", "PEM of the roots that alone vouch for a gateway"),
    ("--install-completion", "Complete commands with Tab in this shell"),
    ("--show-completion", "Print the completion script"),
    ("-h, --help", "Show this page; every command has its own"),
)


def help_page(nouns: Iterable[Noun], *, version: str) -> str:
    """The whole page; styled if stdout is a colour terminal."""
    styled = sys.stdout.isatty() and "NO_COLOR" not in os.environ
    return "\n".join(_lines(list(nouns), version, styled)) + "\n"


def _lines(nouns: list[Noun], version: str, styled: bool) -> Iterator[str]:
    def style(text: str, code: str) -> str:
        return f"\x1b[{code}m{text}\x1b[0m" if styled else text

    yield ""
    yield f"  {style('Meta-ROS', '1')} {style(version, '2')}"
    yield "  Robots on the ROS 2 wire, and the cloud-edge gateway above them."
    yield ""
    yield f"  {style('Usage', '1')}  metaros COMMAND [OPTIONS] …"
    width = max(len(noun.name) for noun in nouns) + 3
    for panel in dict.fromkeys(noun.panel for noun in nouns):
        yield ""
        yield f"  {style(panel, '1')}"
        for noun in nouns:
            if noun.panel == panel:
                yield f"    {style(noun.name.ljust(width), '36')}{noun.summary}"
    yield ""
    yield f"  {style('Options', '1')}"
    for option, text in OPTIONS:
        yield f"    {style(option.ljust(24), '36')}{text}"
    yield ""
    yield f"  {style('Start with', '2')}  metaros up"
