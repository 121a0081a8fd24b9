"""The command lines of benchmarks and campaigns: names, and options for one of them."""

from __future__ import annotations

import importlib
from importlib.util import find_spec

import pytest

from load_tests.__main__ import BENCHMARKS, main, module_of
from load_tests.campaigns.__main__ import CAMPAIGNS


def test_every_benchmark_is_a_module_with_a_main() -> None:
    assert [name for name in BENCHMARKS if find_spec(module_of(name)) is None] == []
    assert callable(importlib.import_module(module_of("peers")).main)


def test_every_campaign_is_a_module_with_a_main() -> None:
    assert [name for name in CAMPAIGNS if find_spec(f"load_tests.campaigns.{name}") is None] == []


def test_an_unknown_name_is_reported_with_those_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["nothing"]) == 2
    assert "peers" in capsys.readouterr().err


@pytest.mark.parametrize("argv", [["--quick"], ["peers", "cdr", "--quick"]])
def test_options_are_for_one_benchmark(argv: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(argv) == 2
    assert "options need the one benchmark" in capsys.readouterr().err
