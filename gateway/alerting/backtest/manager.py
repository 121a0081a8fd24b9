"""Runs backtests: one at a time, on a thread of its own, within bounds of rows and time.

History is read a piece of the time after the other, so that memory does not grow with the time that is asked for; a
piece becomes shorter where there is more in it.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np

from gateway.alerting.anomaly.checks import Check
from gateway.alerting.backtest.replay import Columns, Replay
from gateway.alerting.backtest.report import NS, BacktestRequest, Report, grouped
from gateway.domain.channel import Series
from gateway.domain.finding import SEVERITIES
from gateway.errors import InvalidRequestError, TooManyError
from gateway.store import Store
from metaros.clock import Clock
from metaros.errors import NameError_
from metaros.idl.globs import Glob
from metaros.limits import LIMITS, Limits

__all__ = ["BacktestManager"]

MAX_NAMED, NAME_CHARS = 64, 256
MAX_SPAN_NS = 31 * 86_400 * NS
PIECE_ROWS = 100_000
PIECE_NS = (10 * NS, 900 * NS, 6 * 3600 * NS)  # the shortest, the first, the longest
CHANGES = frozenset({"enabled", "low", "high", "for_s", "clear_s", "severity"})
SPAN_S = 86_400.0  # the longest for_s and clear_s


class BacktestManager:
    """Made and used in the event loop; `close` before the store closes. `checks` are those that hold now."""

    def __init__(
        self, store: Store, *, clock: Clock, checks: Callable[[], Sequence[Check]], limits: Limits = LIMITS
    ) -> None:
        self._store = store
        self._limits = limits
        self._clock = clock
        self._checks = checks
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="gateway-backtest")
        self._busy = False

    async def run(self, request: BacktestRequest) -> Report:
        """What would have fired.

        Raises:
            TooManyError: another one runs.
            InvalidRequestError: a field of the request does not fit; it is named.
        """
        checks = chosen_checks(self._checks(), request.checks, request.detectors)
        if not 0 < request.end_ns - request.start_ns <= MAX_SPAN_NS:
            raise InvalidRequestError("from is earlier than to, by at most 31 days")
        if self._busy:
            raise TooManyError("a backtest runs already; try again when it is done")
        self._busy = True
        try:
            return await self._run(request, checks)
        finally:
            self._busy = False

    def close(self) -> None:
        """Give up what runs."""
        self._thread.shutdown(wait=False, cancel_futures=True)

    async def _run(self, request: BacktestRequest, checks: Sequence[Check]) -> Report:
        began_s = self._clock.monotonic_s()
        series = await self._series(request)
        start_ns, end_ns = request.start_ns, request.end_ns
        replay = Replay(request.robot, series, start_ns=start_ns, end_ns=end_ns, checks=checks)
        loop, names = asyncio.get_running_loop(), [item.name for item in series]
        at_ns, samples, (least_ns, piece_ns, most_ns) = start_ns, 0, PIECE_NS
        while at_ns < end_ns and not self._enough(replay, samples, began_s):
            until_ns = min(end_ns, at_ns + piece_ns)
            columns = await self._rows(request.robot, names, at_ns, until_ns)
            rows = sum(len(item.values) for item in columns)
            if rows > PIECE_ROWS and piece_ns > least_ns:
                piece_ns = max(least_ns, piece_ns // 4)
                continue
            await loop.run_in_executor(
                self._thread,
                lambda: replay.feed(columns, from_ns=at_ns, until_ns=until_ns),  # noqa: B023  # awaited
            )
            at_ns, samples = until_ns, samples + rows
            piece_ns = min(most_ns, piece_ns * 2) if rows < PIECE_ROWS // 4 else piece_ns
        fired = replay.fired()
        return Report(
            robot=request.robot,
            start_ns=start_ns,
            end_ns=at_ns,
            samples=samples,
            findings=fired,
            alerts=grouped(fired),
            series=await loop.run_in_executor(self._thread, replay.series),
            cut=at_ns < end_ns,
            took_s=self._clock.monotonic_s() - began_s,
        )

    def _enough(self, replay: Replay, samples: int, began_s: float) -> bool:
        late = self._clock.monotonic_s() - began_s >= self._limits.backtest_s
        return late or replay.full or samples >= self._limits.backtest_samples

    async def _series(self, request: BacktestRequest) -> list[Series]:
        """The stored series that are meant; InvalidRequestError for a name of none, and for too many."""
        if len(request.series) > MAX_NAMED or any(not 0 < len(name) <= NAME_CHARS for name in request.series):
            raise InvalidRequestError(f"series: at most {MAX_NAMED} names or patterns of 1 to {NAME_CHARS} characters")
        stored = [facts.series for facts in await self._store.series(request.robot)]
        globs = [(name, _glob(name)) for name in request.series]
        for name, glob in globs:
            if not any(glob.matches(item.name) for item in stored):
                raise InvalidRequestError(f"series: the robot has no stored series {name!r}")
        found = [item for item in stored if not globs or any(glob.matches(item.name) for _, glob in globs)]
        if len(found) > (most := self._limits.backtest_series):
            raise InvalidRequestError(f"series: at most {most} at a time, these are {len(found)}: name some")
        return found

    async def _rows(self, robot: str, names: Sequence[str], start_ns: int, end_ns: int) -> list[Columns]:
        """Every row from one stamp to before another; of a series with more than a piece may have, only its line."""
        span = {"start_ns": start_ns, "end_ns": end_ns - 1, "points": PIECE_ROWS}
        found = await self._store.range(robot, names, **span, method="lttb")
        return [
            Columns(item.name, np.round(item.stamp_ms * 1e6).astype(np.int64), item.mean)
            for item in found
            if len(item.stamp_ms)
        ]


def _glob(name: str) -> Glob:
    try:
        return Glob(name, separator=".")
    except NameError_ as error:
        raise InvalidRequestError(f"series: {error}") from error


def chosen_checks(table: Sequence[Check], changes: Mapping[str, Mapping[str, Any]], only: Sequence[str]) -> list[Check]:
    """The table with the changes, and with nothing on but `only`; InvalidRequestError names what does not fit."""
    known = {check.id for check in table}
    for field, ids in (("checks", changes), ("detectors", only)):
        if (strange := next((name for name in ids if name not in known), None)) is not None:
            raise InvalidRequestError(f"{field}: there is no check {strange[:80]!r}")
    for name, fields in changes.items():
        for key, value in fields.items():
            _check_change(name, key, value)
    try:
        changed = [replace(check, **changes.get(check.id, {})) for check in table]
    except ValueError as error:  # fields that do not go together
        raise InvalidRequestError(f"checks: {error}") from error
    return [replace(check, enabled=check.enabled and check.id in only) if only else check for check in changed]


def _check_change(name: str, key: str, value: Any) -> None:
    """InvalidRequestError unless a check may be changed so."""
    number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    fits = {
        "enabled": isinstance(value, bool),
        "severity": value in SEVERITIES,
        "low": number or value is None,
        "high": number or value is None,
        "for_s": number and 0 <= value <= SPAN_S,
        "clear_s": number and 0 <= value <= SPAN_S,
    }
    if key not in fits:
        raise InvalidRequestError(f"checks: {name} has {', '.join(sorted(CHANGES))}, but not {key[:40]!r}")
    if not fits[key]:
        raise InvalidRequestError(f"checks: {key} of {name} does not fit: {str(value)[:40]!r}")
