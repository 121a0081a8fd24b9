"""The points of a map: where each is on the device, and how its registers become a value. Pure."""

from __future__ import annotations

import math
import re
import struct
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final

from metaros.errors import ConfigError

__all__ = ["MAX_POINTS", "TABLES", "Point", "read_map"]

MAX_POINTS: Final = 256
TABLES: Final = ("holding", "input", "coil", "discrete")
_FORMATS: Final[Mapping[str, str]] = {"u16": ">H", "i16": ">h", "u32": ">I", "i32": ">i", "f32": ">f", "bool": ""}
_NAME: Final = re.compile(r"[a-z][a-z0-9_]*(/[a-z][a-z0-9_]*)*")
_REQUIRED: Final = {"name", "table", "address", "type"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One value: raw * scale + offset. `safe` is written when commands end: after `watchdog_s` (0: never for that
    reason), and when the driver ends.
    """

    name: str
    table: str
    address: int
    type: str
    words: str = "big"  # which of two registers comes first: big, the high one
    scale: float = 1.0
    offset: float = 0.0
    period_s: float = 1.0
    unit: str = ""
    writable: bool = False
    min: float | None = None
    max: float | None = None
    safe: float | bool | None = None
    watchdog_s: float = 0.0

    @property
    def is_bit(self) -> bool:
        """Whether it is one bit, not registers."""
        return self.table in ("coil", "discrete")

    @property
    def count(self) -> int:
        """How many registers, or bits, it has."""
        return 2 if self.type.endswith("32") else 1

    def value(self, raw: Sequence[int]) -> float | bool:
        """What those registers, or that bit, mean."""
        if self.is_bit:
            return bool(raw[0])
        ordered = raw if self.words == "big" else raw[::-1]
        data = struct.pack(f">{len(ordered)}H", *ordered)
        return float(struct.unpack(_FORMATS[self.type], data)[0]) * self.scale + self.offset

    def registers(self, value: float | bool) -> tuple[int, ...] | None:
        """What is to be written; None where the value is no number, out of its range, or does not fit the type."""
        if self.is_bit:
            return (int(bool(value)),)
        low = -math.inf if self.min is None else self.min
        high = math.inf if self.max is None else self.max
        if not (math.isfinite(value) and low <= value <= high):
            return None
        raw = (value - self.offset) / self.scale
        try:
            data = struct.pack(_FORMATS[self.type], raw if self.type == "f32" else round(raw))
        except (struct.error, OverflowError):
            return None
        found = struct.unpack(f">{len(data) // 2}H", data)
        return found if self.words == "big" else found[::-1]


def read_map(path: str) -> tuple[Point, ...]:
    """The points of a TOML file with [[points]]. ConfigError names the point and what is wrong with it."""
    if not path:
        raise ConfigError("modbus: map is empty: it names the file that says what the device's registers mean")
    try:
        tree = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"modbus: map: {path}: {error}") from None
    rows = tree.pop("points", [])
    if tree or not isinstance(rows, list) or not rows:
        raise ConfigError(f"modbus: map: {path}: it has [[points]], at least one, and nothing else")
    if len(rows) > MAX_POINTS:
        raise ConfigError(f"modbus: map: {path}: more than {MAX_POINTS} points")
    points = tuple(_point(row, f"{path}: point {number}") for number, row in enumerate(rows, start=1))
    names = [point.name for point in points]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise ConfigError(f"modbus: map: {path}: there twice: {', '.join(twice)}")
    return points


def _point(row: Any, where: str) -> Point:
    if not isinstance(row, dict):
        raise ConfigError(f"modbus: map: {where} is no table")
    known = {item.name: item.type for item in fields(Point)}
    where = f"{where} ({row.get('name', 'no name')})"
    if wrong := (set(row) - set(known)) | (_REQUIRED - set(row)):
        raise ConfigError(f"modbus: map: {where}: unknown or missing: {', '.join(sorted(wrong))}")
    for key, value in row.items():
        if not _fits(str(known[key]), value):
            raise ConfigError(f"modbus: map: {where}: {key} cannot be {value!r}")
    point = Point(**row)
    if problem := _problem(point):
        raise ConfigError(f"modbus: map: {where}: {problem}")
    return point


def _fits(wanted: str, value: Any) -> bool:
    if isinstance(value, bool):
        return "bool" in wanted
    if isinstance(value, int | float):
        return ("float" in wanted or ("int" in wanted and isinstance(value, int))) and math.isfinite(value)
    return isinstance(value, str) and wanted == "str"


def _problem(point: Point) -> str:
    numeric = point.writable and not point.is_bit
    checks = (
        (not _NAME.fullmatch(point.name), "a name has small letters, digits, _ and /"),
        (point.table not in TABLES, f"table is one of {', '.join(TABLES)}"),
        (point.type not in _FORMATS, f"type is one of {', '.join(_FORMATS)}"),
        (point.is_bit != (point.type == "bool"), "coil and discrete are bool, holding and input are not"),
        (point.words not in ("big", "little"), "words is big or little"),
        (not 0 <= point.address <= 65536 - point.count, "address is 0 to 65535"),
        (point.scale == 0, "scale is not 0"),
        (not 0.01 <= point.period_s <= 86400, "period_s is 0.01 to 86400"),
        (point.writable and point.table in ("input", "discrete"), "only holding and coil are writable"),
        (numeric and (point.min is None or point.max is None), "a writable number needs min and max"),
        (bool(point.watchdog_s) and point.safe is None, "watchdog_s needs safe"),
        (not 0 <= point.watchdog_s <= 3600, "watchdog_s is 0 to 3600"),
        (point.safe is not None and not point.writable, "safe is for what is writable"),
    )
    if problem := next((text for wrong, text in checks if wrong), ""):
        return problem
    return "safe is out of range" if point.safe is not None and point.registers(point.safe) is None else ""
