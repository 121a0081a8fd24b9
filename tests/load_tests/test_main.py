"""The front of the benchmarks: names, and options for one of them."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

from load_tests.__main__ import BENCHMARKS, main


def test_every_benchmark_is_a_module_with_a_main() -> None:
    modules = {path.stem.removeprefix("bench_") for path in Path("load_tests").glob("bench_*.py")}
    assert set(BENCHMARKS) <= modules
    assert callable(importlib.import_module("load_tests.bench_peers").main)


def test_an_unknown_name_is_told_with_those_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["nothing"]) == 2
    assert "peers" in capsys.readouterr().err


@pytest.mark.parametrize("argv", [["--quick"], ["peers", "cdr", "--quick"]])
def test_options_are_for_one_benchmark(argv: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(argv) == 2
    assert "options need the one benchmark" in capsys.readouterr().err
