"""The benchmark of stored series with few rows: that it measures what it says, not how fast."""

from __future__ import annotations

import os

import pytest

from load_tests.benchmarks.gateway import history
from tests.support.servers.postgres import postgres_binaries


@pytest.mark.parametrize("engine", ["sqlite", pytest.param("postgres", marks=pytest.mark.integration)])
def test_both_shapes_answer(engine: str, capsys: pytest.CaptureFixture[str]) -> None:
    if engine == "postgres" and postgres_binaries() is None and not os.environ.get("CI"):
        pytest.skip("PostgreSQL is not installed (Debian: apt install postgresql)")
    assert history.main(["--quick", "--engines", engine]) == 0
    rows = [line.split() for line in capsys.readouterr().out.splitlines() if line.startswith(engine)]
    assert [" ".join(row[4:-3]) for row in rows] == ["no levels", "buckets", "lttb"] * 2
    assert all(850 < int(row[-3]) <= 1000 for row in rows)


def test_a_limit_that_is_not_held_is_an_error() -> None:
    options = ["--rows", "20000", "--queries", "1", "--engines", "sqlite", "--shapes", "one"]
    assert history.main([*options, "--limit-ms", "0"]) == 1
