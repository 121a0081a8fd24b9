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
    lines = [line.split() for line in capsys.readouterr().out.splitlines()[1:-1]]
    assert [line[0] for line in lines] == [engine] * 4
    assert [line[4] for line in lines] == ["buckets", "lttb"] * 2
    assert all(900 < int(line[5]) <= 1000 for line in lines)


def test_a_limit_that_is_not_held_is_an_error() -> None:
    options = ["--rows", "20000", "--queries", "1", "--engines", "sqlite", "--shapes", "one"]
    assert history.main([*options, "--limit-ms", "0"]) == 1
