"""Folders of NAB-style files: series as `timestamp,value` CSV, and the windows that people labelled in them."""

from __future__ import annotations

import csv
import gzip
import json
from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

__all__ = ["FilesError", "Series", "read_folder", "read_scores"]

_DATA = ("data", "")  # where under a folder the files are: NAB's own layout, or right there
_WINDOWS = ("windows.json", "labels/combined_windows.json")


class FilesError(Exception):
    """The folder is not what it should be; the text says what and where."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """One file: its rows in the order of the file, and its windows by row index, both ends inside."""

    name: str  # "<category>/<file>.csv"
    stamps_s: np.ndarray
    values: np.ndarray
    windows: tuple[tuple[int, int], ...] = ()

    @property
    def category(self) -> str:
        """The folder that the file is in; empty for one that is in none."""
        return self.name.rpartition("/")[0]

    @property
    def probation(self) -> int:
        """How many rows at the start are never scored."""
        return min(len(self.values) * 15 // 100, 750)


def read_folder(folder: Path) -> tuple[list[Series], bool]:
    """All series under a folder by name, and whether there are labels.

    Takes `data/<category>/<name>.csv`, `<category>/<name>.csv` and `<name>.csv`; labels are `windows.json` or NAB's
    `labels/combined_windows.json`: name to a list of [start, end].

    Raises:
        FilesError: no file, or one that cannot be read; names the file and its line.
    """
    root = next((folder / part for part in _DATA if (folder / part).is_dir()), folder)
    paths = sorted({*root.glob("*.csv"), *root.glob("*/*.csv")})
    if not paths:
        raise FilesError(f"no CSV files under {folder}: data/<category>/<name>.csv, or <name>.csv")
    labels = next((folder / name for name in _WINDOWS if (folder / name).is_file()), None)
    windows = json.loads(labels.read_text()) if labels else {}
    return [_series(path, path.relative_to(root).as_posix(), windows) for path in paths], labels is not None


def read_scores(path: Path) -> np.ndarray:
    """The score of each row, as published: `timestamp,anomaly_score`, gzipped or not."""
    data = path.read_bytes()
    rows = csv.reader((gzip.decompress(data) if path.suffix == ".gz" else data).decode().splitlines())
    column = next(rows).index("anomaly_score")
    return np.array([float(row[column]) for row in rows])


def _series(path: Path, name: str, windows: dict[str, list[list[str]]]) -> Series:
    stamps, values = [], []
    with path.open(newline="") as lines:
        rows = csv.reader(lines)
        next(rows, None)
        for row in rows:
            try:
                stamps.append(_stamp_s(row[0]))
                values.append(float(row[1]))
            except (IndexError, ValueError):
                raise FilesError(f"{path}, line {rows.line_num}: no timestamp,value: {','.join(row)[:80]!r}") from None
    ends = [(_stamp_s(start), _stamp_s(end)) for start, end in windows.get(name, [])]
    return Series(
        name=name,
        stamps_s=np.array(stamps),
        values=np.array(values),
        windows=tuple((_row(stamps, start), _row(stamps, end, last=True)) for start, end in ends),
    )


def _row(stamps: list[float], wanted: float, *, last: bool = False) -> int:
    """The first row of that time; of a window that no row ends with, the nearest row inside it."""
    if wanted in stamps:
        return stamps.index(wanted)
    return bisect_right(stamps, wanted) - 1 if last else bisect_left(stamps, wanted)


def _stamp_s(text: str) -> float:
    return datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp()
