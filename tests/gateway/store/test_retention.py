"""The plan of what goes: pure; and the rules on the command line."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.store.retention import CLASSES, ClassLimit, Holding, PlannedDeletion, Retention, Usage, class_limits, plan
from metaros.errors import ConfigError

S = 10**9
NOW_NS = 1000 * S
HUGE = 1 << 60


def holding(name: str, age_s: float, size_bytes: int = 10) -> Holding:
    """One of a class, stored so long ago."""
    return Holding(name, "segments", 1, round(NOW_NS - age_s * S), size_bytes)


def going(retention: Retention, holdings: list[Holding], *, total_bytes: int | None = None) -> list[PlannedDeletion]:
    """The whole plan."""
    by_class = {name: [item for item in holdings if item.kind == name] for name in CLASSES}
    sums = {name: sum(item.size_bytes for item in items) for name, items in by_class.items()}
    total = sum(sums.values()) if total_bytes is None else total_bytes

    def oldest(name: str) -> Iterator[Holding]:
        return iter(sorted(by_class[name], key=lambda item: item.stored_ns))

    return list(plan(retention, Usage(total, sums), oldest, now_ns=NOW_NS))


def shown(items: list[PlannedDeletion]) -> list[tuple[str, float, str]]:
    """Class, age and reason of each."""
    return [(item.holding.kind, (NOW_NS - item.holding.stored_ns) / S, item.why) for item in items]


def test_age_by_class() -> None:
    retention = Retention(age_s=10, event_age_s=100, size_bytes=HUGE, classes={"metric": ClassLimit(age_s=50)})
    holdings = [holding(name, age_s) for name in CLASSES for age_s in (5, 20, 60, 200)]
    assert shown(going(retention, holdings)) == [
        ("metric", 200, "age"),
        ("metric", 60, "age"),
        ("bulk", 200, "age"),
        ("bulk", 60, "age"),
        ("bulk", 20, "age"),
        ("event", 200, "age"),
        ("recording", 200, "age"),
    ]


def test_size_of_a_class_takes_its_oldest() -> None:
    retention = Retention(age_s=100, size_bytes=HUGE, classes={"bulk": ClassLimit(size_bytes=25)})
    holdings = [holding(name, age_s) for name in ("bulk", "metric") for age_s in (1, 2, 3, 4, 200)]
    assert shown(going(retention, holdings)) == [
        ("metric", 200, "age"),
        ("bulk", 200, "age"),
        ("bulk", 4, "class_size"),
        ("bulk", 3, "class_size"),
    ]


def test_size_of_all_takes_metric_and_bulk_together_then_recordings_then_events() -> None:
    holdings = [holding(name, age_s) for name in CLASSES for age_s in (1, 2)]
    retention = Retention(age_s=100, size_bytes=0)
    assert shown(going(retention, holdings)) == [
        ("metric", 2, "store_size"),
        ("bulk", 2, "store_size"),
        ("metric", 1, "store_size"),
        ("bulk", 1, "store_size"),
        ("recording", 2, "store_size"),
        ("recording", 1, "store_size"),
        ("event", 2, "store_size"),
        ("event", 1, "store_size"),
    ]
    assert len(going(Retention(age_s=100, size_bytes=55), holdings)) == 3
    assert going(Retention(age_s=100, size_bytes=80), holdings) == []


def test_only_what_goes_is_read() -> None:
    read = []

    def oldest(name: str) -> Iterator[Holding]:
        for age_s in range(50, 0, -1):
            read.append(name)
            yield holding(name, age_s)

    items = list(plan(Retention(age_s=48.5, size_bytes=HUGE), Usage(2000), oldest, now_ns=NOW_NS))
    assert len(items) == 2 * len(CLASSES)
    assert len(read) == 3 * len(CLASSES)


@settings(max_examples=50)
@given(
    st.lists(st.tuples(st.sampled_from(CLASSES), st.integers(0, 100), st.integers(1, 50)), max_size=60),
    st.integers(0, 1500),
    st.dictionaries(st.sampled_from(CLASSES), st.builds(ClassLimit, size_bytes=st.integers(0, 500)), max_size=4),
)
def test_bounds_hold_and_nothing_goes_for_nothing(
    rows: list[tuple[str, int, int]], most: int, classes: dict[str, ClassLimit]
) -> None:
    holdings = [holding(*row) for row in rows]
    retention = Retention(age_s=80, event_age_s=90, size_bytes=most, classes=classes)
    items = going(retention, holdings)
    gone = [item.holding for item in items]
    assert len({id(item) for item in gone}) == len(gone)
    left = [item for item in holdings if id(item) not in {id(other) for other in gone}]
    assert sum(item.size_bytes for item in left) <= most
    for name in CLASSES:
        mine = [item for item in left if item.kind == name]
        limit = retention.limit(name)
        assert all(item.stored_ns >= retention.before_ns(name, now_ns=NOW_NS) for item in mine)
        assert limit.size_bytes is None or sum(item.size_bytes for item in mine) <= limit.size_bytes
        last = [item.holding for item in items if item.holding.kind == name][-1:]
        assert all(item.stored_ns >= last[0].stored_ns for item in mine if last)
    if items and items[-1].why == "store_size":
        assert sum(item.size_bytes for item in left) + gone[-1].size_bytes > most


def test_rules() -> None:
    assert class_limits(["bulk=3d,20GiB", "metric=1.5h", "event=,512MiB"]) == {
        "bulk": ClassLimit(age_s=3 * 86400, size_bytes=20 << 30),
        "metric": ClassLimit(age_s=5400),
        "event": ClassLimit(size_bytes=512 << 20),
    }
    for rule in ("bulk", "bulk=", "bulk=,", "live=3d", "bulk=3", "bulk=3d,", "bulk=0s", "bulk=3d,20GB", "bulk=-3d"):
        with pytest.raises(ConfigError, match=r"CLASS=AGE,SIZE|more than 0"):
            class_limits([rule])
    with pytest.raises(ConfigError, match="once"):
        class_limits(["bulk=3d", "bulk=4d"])
