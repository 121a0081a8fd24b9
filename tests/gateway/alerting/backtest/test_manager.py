"""Backtests over a real store: which rows are read, what is refused, and where it ends."""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import pytest
import pytest_asyncio

from gateway.alerting.anomaly.defaults import DEFAULT_CHECKS
from gateway.alerting.backtest import BacktestManager, BacktestRequest, Report
from gateway.alerting.backtest import manager as manager_module
from gateway.alerting.backtest.report import NS
from gateway.domain.channel import Series
from gateway.domain.robot import Robot
from gateway.errors import InvalidRequestError, TooManyError
from gateway.store import RobotWrite, Store
from gateway.store.retention import Retention
from metaros.clock import ManualClock, SystemClock
from metaros.limits import Limits
from tests.gateway.store.samples import write

pytestmark = pytest.mark.asyncio(loop_scope="module")
START_NS = 1_790_000_000 * NS
SECONDS = 100
MOTOR = Series("motor_left.temperature", "/r1/motor_left", "temperature")
CHARGE = Series("battery_state.percentage", "/r1/battery_state", "percentage")
REQUEST = BacktestRequest(robot="r1", start_ns=START_NS, end_ns=START_NS + SECONDS * NS)
VALUES = ("threshold",)


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def store(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Store]:
    """A store with some seconds of a motor that gets hot, and of a battery that does not."""
    store = Store(
        tmp_path_factory.mktemp("store"),
        clock=SystemClock(),
        retention=Retention(age_s=1e9, size_bytes=1 << 30),
        queue_bytes=1 << 24,
        url="",
    )
    store.start()
    store.submit(RobotWrite(Robot("r1", "/r1", "host", "1", {}), 7))
    rows = []
    for second in range(SECONDS):
        at_ns = START_NS + second * NS
        rows += [(MOTOR, at_ns, 90.0 if 40 <= second < 80 else 40.0 + math.sin(second))]
        rows += [(CHARGE, at_ns, 0.9 - second * 1e-5)]
    store.submit(write(len(rows), *rows))
    await store.flush()
    yield store
    await store.close()


@contextmanager
def backtests(store: Store, **options: Any) -> Iterator[BacktestManager]:
    """A desk over that store."""
    checks = tuple(check for check in DEFAULT_CHECKS if check.kind in VALUES)
    manager = BacktestManager(store, **{"clock": SystemClock(), "checks": lambda: checks, **options})
    try:
        yield manager
    finally:
        manager.close()


async def test_what_would_have_fired(store: Store) -> None:
    with backtests(store) as manager:
        report = await manager.run(REQUEST)
    assert (report.robot, report.samples, report.cut) == ("r1", 2 * SECONDS, False)
    assert (report.start_ns, report.end_ns) == (REQUEST.start_ns, REQUEST.end_ns)
    assert [item.finding.kind for item in report.findings] == ["motor_hot"]
    (alert,) = report.alerts
    assert (alert.cause, alert.findings) == ("heat", 1)
    assert [(one.series, one.samples) for one in report.series] == [(MOTOR.name, SECONDS), (CHARGE.name, SECONDS)]


async def test_other_checks_and_some_of_the_series(store: Store) -> None:
    with backtests(store) as manager:

        async def ran(**changes: Any) -> Report:
            return await manager.run(replace(REQUEST, **changes))

        assert (await ran(checks={"motor_hot": {"enabled": False}})).findings == ()
        assert (await ran(detectors=("battery_low",))).findings == ()
        low = await ran(checks={"battery_low": {"low": 0.95, "for_s": 0}}, detectors=("battery_low",))
        assert [item.finding.series for item in low.findings] == [CHARGE.name]
        some = await ran(series=("battery_state.*",))
        assert [one.series for one in some.series] == [CHARGE.name]
        early = await ran(end_ns=START_NS + 30 * NS)
        assert (early.samples, early.findings) == (60, ())
        nothing = await ran(start_ns=1, end_ns=2)
        assert (nothing.samples, nothing.series, nothing.cut) == (0, (), False)


REFUSED: tuple[tuple[dict[str, Any], str], ...] = (
    ({"checks": {"motor": {"high": 1.0}}}, "checks: there is no check 'motor'"),
    ({"detectors": ("level",)}, "detectors: there is no check 'level'"),
    ({"checks": {"motor_hot": {"hihg": 1.0}}}, "not 'hihg'"),
    ({"checks": {"motor_hot": {"high": "hot"}}}, "high of motor_hot does not fit"),
    ({"checks": {"motor_hot": {"high": math.nan}}}, "high of motor_hot does not fit"),
    ({"checks": {"motor_hot": {"for_s": -1.0}}}, "for_s of motor_hot does not fit"),
    ({"checks": {"motor_hot": {"severity": "bad"}}}, "severity of motor_hot does not fit"),
    ({"checks": {"motor_hot": {"low": 100.0}}}, "low must be below high"),
    ({"series": ("wheel",)}, "series: the robot has no stored series 'wheel'"),
    ({"series": ("x",) * 65}, "series: at most 64"),
    ({"series": ("a b",)}, "no pattern"),
    ({"end_ns": START_NS}, "from is earlier than to"),
    ({"end_ns": START_NS + 40 * 86_400 * NS}, "at most 31 days"),
)


async def test_what_does_not_fit_is_named(store: Store) -> None:
    failures = []
    with backtests(store) as manager:
        for changes, said in REFUSED:
            try:
                await manager.run(replace(REQUEST, **changes))
            except InvalidRequestError as error:
                failures += [] if said in str(error) else [(changes, str(error))]
            else:
                failures.append((changes, "it was run"))
        assert (await manager.run(REQUEST)).findings, "it is busy after a refusal"
    assert failures == []


async def test_one_at_a_time(store: Store) -> None:
    with backtests(store) as manager:
        first = asyncio.create_task(manager.run(REQUEST))
        await asyncio.sleep(0)
        with pytest.raises(TooManyError, match="runs already"):
            await manager.run(REQUEST)
        assert (await first).findings


async def test_it_ends_at_its_bounds(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(manager_module, "PIECE_NS", (10 * NS, 60 * NS, 60 * NS))
    with backtests(store, limits=Limits(backtest_samples=100)) as manager:
        report = await manager.run(REQUEST)
        assert (report.cut, report.samples, report.end_ns) == (True, 120, START_NS + 60 * NS)
        monkeypatch.setattr(manager_module, "PIECE_ROWS", 50)
        report = await manager.run(REQUEST)
        assert (report.cut, report.samples, report.end_ns) == (True, 120, START_NS + 60 * NS), "in shorter pieces"
    with backtests(store, clock=ManualClock(), limits=Limits(backtest_s=0.0)) as manager:
        report = await manager.run(REQUEST)
        assert (report.cut, report.samples, report.end_ns) == (True, 0, START_NS)
    with backtests(store, limits=Limits(backtest_series=1)) as manager:
        with pytest.raises(InvalidRequestError, match="at most 1 at a time, these are 2"):
            await manager.run(REQUEST)
