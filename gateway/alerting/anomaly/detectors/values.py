"""Thresholds with hysteresis and rates of change: the rows of the table whose limits are numbers, over all series."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gateway.alerting.anomaly.checks import Check, CheckTable
from gateway.alerting.anomaly.condition_states import ConditionStates
from gateway.alerting.anomaly.detectors.cells import Second
from gateway.alerting.anomaly.detectors.columns import Columns, Ints

__all__ = ["ValueChange", "Values"]

LIMITS = ("low", "high", "low_clear", "high_clear", "for_s", "clear_s", "window_s")


@dataclass(frozen=True, slots=True)
class ValueChange:
    """A check opened or closed at a slot."""

    slot: int
    check: Check
    opened: bool
    value: float


class Values:
    """One row an attached pair of slot and check."""

    def __init__(self) -> None:
        nan = np.float64(np.nan)
        self._pairs: dict[int, list[tuple[int, Check]]] = {}  # by slot: rows
        self._checks: list[Check | None] = []
        self._free: list[int] = []
        self.holds = ConditionStates()
        self.columns = Columns(
            slot=np.int64(-1), low=nan, high=nan, low_clear=nan, high_clear=nan, for_s=nan, clear_s=nan, window_s=nan,
            ref=nan, ref_s=nan, next_ref=nan, next_s=nan,
        )  # fmt: skip

    def attach(self, slot: int, name: str, table: CheckTable) -> None:
        """Look at a slot by all rows that name its series; what is attached already stays in its state."""
        before = {check: row for row, check in self._pairs.pop(slot, ())}
        wanted = [table.rows[number] for number in table.of(name, "threshold", "change")]
        for check, row in before.items():
            if check not in wanted:
                self._release(row)
        pairs = [(before[check] if check in before else self._take(slot, check), check) for check in wanted]
        if pairs:
            self._pairs[slot] = pairs

    def detach(self, slot: int) -> None:
        """Nothing is looked at any more."""
        for row, _ in self._pairs.pop(slot, ()):
            self._release(row)

    def feed(self, second: Second) -> list[ValueChange]:
        """Judge a second of some slots."""
        slots = self.columns["slot"][: len(self._checks)]
        if not len(slots):
            return []
        place = np.full(int(max(slots.max(), second.slots.max())) + 1, -1)
        place[second.slots] = np.arange(len(second.slots))
        at = np.where(slots >= 0, place[slots], -1)
        rows = np.flatnonzero(at >= 0)
        if not len(rows):
            return []
        mean = second.mean[at[rows]]
        columns = self.columns
        looked = np.where(columns["window_s"][rows] > 0.0, self._slope(rows, mean, second.at_s), mean)
        breached = (looked <= columns["low"][rows]) | (looked >= columns["high"][rows])
        inside = (looked > columns["low_clear"][rows]) & (looked < columns["high_clear"][rows])
        opened, cleared = self.holds.step(
            rows, breached, inside, second.at_s, for_s=columns["for_s"][rows], clear_s=columns["clear_s"][rows]
        )
        return [
            ValueChange(int(slots[rows[n]]), check, bool(opened[n]), float(looked[n]))
            for n in np.flatnonzero(opened | cleared).tolist()
            if (check := self._checks[rows[n]]) is not None
        ]

    def dump(self) -> dict[str, Mapping[str, npt.NDArray[Any]]]:
        """All state but the checks, which are attached anew in the same order."""
        ids = np.array([f"{check.id}" if check is not None else "" for check in self._checks], dtype=np.str_)
        return {
            "values": self.columns.dump(),
            "values.holds": self.holds.columns.dump(),
            "values.rows": {"ids": ids, "free": np.array(self._free, np.int64)},
        }

    def load(self, parts: Mapping[str, Mapping[str, npt.NDArray[Any]]], table: CheckTable) -> None:
        """Take over what `dump` gave; rows whose check is not in the table any more are let go."""
        self.columns.load(parts["values"])
        self.holds.columns.load(parts["values.holds"])
        self._free = parts["values.rows"]["free"].tolist()
        slots = self.columns["slot"].tolist()
        for row, check_id in enumerate(parts["values.rows"]["ids"].tolist()):
            check = table.get(check_id) if check_id else None
            self._checks.append(check)
            if check is not None:
                self._pairs.setdefault(slots[row], []).append((row, check))
                self._write(row, slots[row], check)
            elif check_id:
                self._release(row)

    def take(self, slots: Ints) -> dict[str, npt.NDArray[Any]]:
        """The state of what is attached to some slots; `at` says to which of them."""
        pairs = [(at, row, check) for at, slot in enumerate(slots.tolist()) for row, check in self._pairs.get(slot, ())]
        rows = np.array([row for _, row, _ in pairs], np.int64)
        return {
            "at": np.array([at for at, _, _ in pairs], np.int64),
            "ids": np.array([check.id for _, _, check in pairs], np.str_),
            **{f"holds.{name}": array for name, array in self.holds.columns.take(rows).items()},
            **self.columns.take(rows),
        }

    def put(self, slots: Ints, arrays: Mapping[str, npt.NDArray[Any]]) -> None:
        """Go on from what `take` gave, as far as the same checks with the same limits are attached to these slots.

        Raises KeyError, IndexError and ValueError.
        """
        attached = {(slot, check.id): row for slot in slots.tolist() for row, check in self._pairs.get(slot, ())}
        holds = {name.partition(".")[2]: array for name, array in arrays.items() if name.startswith("holds.")}
        own = {name: array for name, array in arrays.items() if name not in ("at", "ids") and "." not in name}
        for place, (at, check) in enumerate(zip(arrays["at"].tolist(), arrays["ids"].tolist(), strict=True)):
            row, one = attached.get((int(slots[at]), check), -1), slice(place, place + 1)
            if row >= 0 and all(own[name][place] == self.columns[name][row] for name in LIMITS):
                self.columns.put(np.array([row]), {name: array[one] for name, array in own.items()}, keep=("slot",))
                self.holds.columns.put(np.array([row]), {name: array[one] for name, array in holds.items()})

    def _take(self, slot: int, check: Check) -> int:
        row = self._free.pop() if self._free else len(self._checks)
        if row == len(self._checks):
            self._checks.append(None)
            for columns in (self.columns, self.holds.columns):
                columns.grow(row + 1)
        self._checks[row] = check
        self._write(row, slot, check)
        return row

    def _release(self, row: int) -> None:
        self._free.append(row)
        self._checks[row] = None
        for columns in (self.columns, self.holds.columns):
            columns.reset(row)

    def _write(self, row: int, slot: int, check: Check) -> None:
        low = check.low if check.low is not None else -np.inf
        high = check.high if check.high is not None else np.inf
        new = {
            "slot": slot, "low": low, "high": high, "low_clear": low + check.hysteresis,
            "high_clear": high - check.hysteresis, "for_s": check.for_s, "clear_s": check.clear_s,
            "window_s": check.window_s if check.kind == "change" else 0.0,
        }  # fmt: skip
        for name, value in new.items():
            self.columns[name][row] = value

    def _slope(self, rows: Ints, mean: npt.NDArray[np.float64], at_s: float) -> npt.NDArray[np.float64]:
        """Change per second since a reference one to two windows old; 0 until there is one."""
        columns = self.columns
        window = columns["window_s"][rows]
        age = at_s - columns["next_s"][rows]
        turn = ~((age >= 0.0) & (age < window))
        lost = ~((age >= 0.0) & (age < 3.0 * window + 10.0))
        ref = np.where(turn, np.where(lost, np.nan, columns["next_ref"][rows]), columns["ref"][rows])
        ref_s = np.where(turn, np.where(lost, np.nan, columns["next_s"][rows]), columns["ref_s"][rows])
        columns["ref"][rows], columns["ref_s"][rows] = ref, ref_s
        columns["next_ref"][rows] = np.where(turn, mean, columns["next_ref"][rows])
        columns["next_s"][rows] = np.where(turn, at_s, columns["next_s"][rows])
        return np.nan_to_num((mean - ref) / np.maximum(at_s - ref_s, 1e-9))
