"""`metaros anomaly`: the gateway's detectors on a file, without a gateway."""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from metaros.errors import UsageError

__all__ = ["read_samples", "register"]

File = Annotated[Path, typer.Argument(metavar="[FILE]", help="CSV with the header timestamp,value; - is stdin.")]
COLUMNS = ("timestamp", "value")


def register(app: typer.Typer) -> None:
    """Add the noun to `metaros`."""
    noun = typer.Typer(no_args_is_help=True, help="The gateway's detectors, on files.")
    noun.callback()(_noun)  # or a single verb would have no name
    noun.command("score")(_score)
    app.add_typer(noun, name="anomaly")


def _noun() -> None:
    pass


def _score(file: File = Path("-")) -> None:
    """Print one score in [0, 1] a row, as the rows come; 0.5 and more is an alert. All with the fixed parameters."""
    from gateway.alerting.anomaly.detectors.stream import Stream

    stream = Stream()
    with ExitStack() as opened:
        try:
            lines = sys.stdin if str(file) == "-" else opened.enter_context(file.open(encoding="utf-8-sig"))
        except OSError as error:
            raise UsageError(f"{file}: {error.strerror}") from None
        for stamp_s, value in read_samples(lines):
            sys.stdout.write(f"{stream.update(stamp_s, value)}\n")
            sys.stdout.flush()  # whoever feeds a pipe row by row reads row by row


def read_samples(lines: Iterable[str]) -> Iterator[tuple[float, float]]:
    """Seconds since the epoch and value of each row; an empty value is NaN. Times without a zone are UTC.

    Raises:
        UsageError: names the line: no header with both columns, no time, no number, a line that is no CSV.
    """
    rows = csv.reader(lines)
    try:
        header = [name.strip("\ufeff ").lower() for name in next(rows, [])]
        if not set(COLUMNS) <= set(header):
            raise UsageError(f"line 1: no header with timestamp and value: {','.join(header)[:80]!r}")
        time_at, value_at = (header.index(name) for name in COLUMNS)
        for row in rows:
            if row:
                yield _sample(row, time_at, value_at, rows.line_num)
    except csv.Error as error:
        raise UsageError(f"line {rows.line_num}: {error}") from None
    except UnicodeDecodeError as error:
        raise UsageError(f"line {rows.line_num + 1}: {error}") from None


def _sample(row: list[str], time_at: int, value_at: int, line: int) -> tuple[float, float]:
    if len(row) <= max(time_at, value_at):
        raise UsageError(f"line {line}: {len(row)} columns, without timestamp and value")
    time, value = row[time_at].strip(), row[value_at].strip()
    try:
        stamp_s = _stamp_s(time)
    except (ValueError, OverflowError):
        raise UsageError(f"line {line}: timestamp {time[:40]!r} is neither ISO 8601 nor seconds") from None
    try:
        return stamp_s, float(value or "nan")
    except ValueError:
        raise UsageError(f"line {line}: value {value[:40]!r} is no number") from None


def _stamp_s(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        moment = datetime.fromisoformat(text)
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
