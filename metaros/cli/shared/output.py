"""Printing for two readers: tables and colours on a terminal, plain columns in a pipe, JSON on request."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Callable, Container, Iterable, Sequence
from typing import Any, Final, Literal

from metaros.cli.shared.options import Format
from metaros.sanitize import sanitize, sanitize_json

__all__ = ["Output", "counted", "human_bytes", "human_seconds", "sanitize"]

_STYLE: Final = re.compile(r"\x1b\[([\d;]*)m")


class Output:
    """One command's standard output."""

    def __init__(self, format_: Format = Format.TEXT) -> None:
        self.json = format_ in (Format.JSON, Format.YAML)  # for machines
        self._yaml = format_ is Format.YAML
        self.tty = sys.stdout.isatty() and os.environ.get("TERM") != "dumb"
        self.colour = self.tty and "NO_COLOR" not in os.environ
        self._styles: set[str] = set()  # that this command uses; others come from outside

    def table(
        self,
        columns: Sequence[str],
        rows: Iterable[Sequence[object]],
        *,
        empty: str = "",
        right: Container[int] = (),
    ) -> None:
        """Rows under headings; the first column is the one people look for, those in `right` are numbers.

        `empty` is said when there is none.
        """
        texts = [[sanitize(str(cell)) for cell in row] for row in rows]
        if not texts:
            if self.tty and empty:
                self.note(empty)
            return
        if self.tty:
            self._rich_table(columns, texts, right)
        else:
            self._columns(texts)

    def listing(
        self,
        columns: Sequence[str],
        items: Sequence[Any],
        row: Callable[[Any], Sequence[object]],
        *,
        empty: str = "",
        right: Container[int] = (),
    ) -> None:
        """What a `list` command found: the items themselves as JSON, or `row` of each as a table."""
        if self.json:
            self.objects(items)
        else:
            self.table(columns, [row(item) for item in items], empty=empty, right=right)

    def names(self, names: Sequence[str], *, count: bool = False) -> None:
        """Names, one a line; or only how many they are."""
        if count:
            self.line(str(len(names)))
        elif self.json:
            self.objects(list(names))
        else:
            for name in names:
                self.line(sanitize(name))

    def objects(self, value: Any) -> None:
        """One JSON, or YAML, document."""
        if self._yaml:
            self._write(_yaml(value).rstrip("\n"))
        else:
            self._write(sanitize_json(json.dumps(value, indent=2 if self.tty else None, ensure_ascii=False)))

    def object_line(self, value: Any) -> None:
        """One JSON value of a stream, or a YAML document, flushed so that a pipe sees it now."""
        if self._yaml:
            self._write(f"{_yaml(value)}---")
        else:
            self._write(sanitize_json(json.dumps(value, ensure_ascii=False)))

    def line(self, text: str = "") -> None:
        """Plain text, with colours of `style`; nothing else in it is obeyed by a terminal."""
        self._write(self._shown(text))

    def note(self, text: str) -> None:
        """A remark for people, on stderr, so that it never mixes with data."""
        text = self._shown(text)
        sys.stderr.write(f"\x1b[2m{text}\x1b[0m\n" if self.colour else f"{text}\n")
        sys.stderr.flush()

    def style(self, text: str, code: str) -> str:
        """`text` with an ANSI style on a colour terminal."""
        self._styles |= {code, "0"}
        return f"\x1b[{code}m{text}\x1b[0m" if self.colour else text

    def _write(self, text: str) -> None:
        sys.stdout.write(f"{text}\n")
        sys.stdout.flush()

    def _shown(self, text: str) -> str:
        """The text with line ends, tabs and, on a colour terminal, styles; the rest of control codes written out."""
        return text if text.isprintable() else "\n".join(map(self._row, text.split("\n")))

    def _row(self, row: str) -> str:
        shown, end = "", 0
        for found in _STYLE.finditer(row) if self.colour else ():
            if found[1] in self._styles:
                shown += _but_tabs(row[end : found.start()]) + found[0]
                end = found.end()
        return shown + _but_tabs(row[end:])

    def _columns(self, rows: list[list[str]]) -> None:
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        for row in rows:
            self.line("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())

    def _rich_table(self, columns: Sequence[str], rows: list[list[str]], right: Container[int]) -> None:
        from rich import box
        from rich.console import Console
        from rich.table import Table
        from rich.text import Text

        table = Table(box=box.SIMPLE_HEAD, header_style="bold", pad_edge=False, show_edge=False)
        for number, column in enumerate(columns):
            justify: Literal["left", "right"] = "right" if number in right else "left"
            table.add_column(column, style="cyan" if number == 0 else None, overflow="fold", justify=justify)
        for row in rows:
            table.add_row(*(Text(cell) for cell in row))
        Console().print(table)


def _yaml(value: Any) -> str:
    """The value as YAML; where something in it is no plain text, everything beyond ASCII is written out."""
    import yaml

    plain = json.loads(json.dumps(value))
    text = yaml.safe_dump(plain, allow_unicode=True, sort_keys=False, width=120)
    if not text.replace("\n", "").isprintable():
        text = yaml.safe_dump(plain, allow_unicode=False, sort_keys=False, width=120)
    return text.removesuffix("...\n")


def _but_tabs(text: str) -> str:
    return "\t".join(map(sanitize, text.split("\t")))


def counted(number: int, word: str) -> str:
    """`1 topic`, `2 topics`, `3 mismatches`."""
    plural = f"{word}es" if word.endswith("ch") else f"{word}s"
    return f"{number} {word if number == 1 else plural}"


def human_bytes(count: float) -> str:
    """`1.23 kB`: decimal units, three significant digits."""
    for unit in ("B", "kB", "MB"):
        if abs(count) < 999.5:
            return f"{count:.0f} {unit}" if unit == "B" or count >= 99.95 else f"{count:.3g} {unit}"
        count /= 1000.0
    return f"{count:.3g} GB"


def human_seconds(seconds: float) -> str:
    """`3 s`, `4 min`, `2 h 5 min`: an age at a glance."""
    minutes, whole = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {whole} s" if minutes else f"{whole} s"
