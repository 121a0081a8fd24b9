"""When it is full: pure."""

from __future__ import annotations

import pytest

from gateway.store.forecast import ClassFlow, Forecast, days_until, forecast


def flow(size_bytes: int, bytes_per_day: float, **more: float) -> ClassFlow:
    """A class."""
    return ClassFlow(size_bytes=size_bytes, bytes_per_day=bytes_per_day, **more)  # type: ignore[arg-type]


def test_unbounded_classes_grow_on() -> None:
    assert days_until([flow(0, 10), flow(50, 30)], 200) == 5
    assert days_until([flow(0, 10)], 0) == 0
    assert days_until([flow(0, 0)], 1) is None
    assert days_until([], 1) is None


def test_a_class_grows_to_its_own_bound() -> None:
    assert days_until([flow(0, 10, keep_days=7)], 70) == 7
    assert days_until([flow(0, 10, keep_days=7)], 71) is None
    assert days_until([flow(65, 10, keep_days=7)], 6) is None
    assert days_until([flow(100, 10, keep_days=7)], 1) is None  # shrinks rather
    assert days_until([flow(40, 10, keep_days=9, keep_bytes=60)], 20) == 2
    # 2 days of both, then 1 a day alone
    assert days_until([flow(0, 10, keep_days=2), flow(0, 1)], 25) == pytest.approx(5)


def test_the_disk_is_full_only_when_that_comes_first() -> None:
    flows = [flow(100, 10), flow(0, 10, local=False)]
    assert forecast(flows, total_bytes=100, keep_bytes=200, disk_free_bytes=20) == Forecast(5, 2)
    assert forecast(flows, total_bytes=100, keep_bytes=120, disk_free_bytes=20) == Forecast(1, None)
    assert forecast(flows, total_bytes=100, keep_bytes=120, disk_free_bytes=None) == Forecast(1, None)
    assert forecast(flows, total_bytes=130, keep_bytes=120, disk_free_bytes=5) == Forecast(0, None)
    assert forecast([flow(9, 0)], total_bytes=9, keep_bytes=99, disk_free_bytes=1) == Forecast(None, None)
