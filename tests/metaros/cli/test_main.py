"""The program as a process: version, help, errors, exit codes, pipes."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from metaros.cli.main import exit_code
from metaros.errors import FieldError, MetarosError, TimeoutError_


def metaros(*arguments: str, **options: object) -> subprocess.CompletedProcess[str]:
    """Run it without a terminal."""
    return subprocess.run([sys.executable, "-m", "metaros", *arguments], capture_output=True, text=True, **options)  # type: ignore[call-overload,no-any-return]


def test_help_names_every_noun() -> None:
    page = metaros("--help").stdout
    nouns = "up status doctor router topic node service action param interface graph top sim play driver"
    for noun in nouns.split():
        assert f"\n    {noun} " in page
    assert "\x1b" not in page


@pytest.mark.parametrize(
    ("arguments", "heavy"),
    [
        (["--help"], {"numpy", "rich", "zenoh", "grpc", "fastapi"}),
        (["agent", "--help"], {"numpy", "zenoh", "grpc"}),
        (["gateway", "--help"], {"numpy", "zenoh", "grpc", "fastapi"}),
    ],
)
def test_help_loads_nothing_heavy(arguments: list[str], heavy: set[str]) -> None:
    code = (
        f"import sys\ntry:\n from metaros.cli.main import main; main({arguments})\nexcept SystemExit: pass\n"
        f"print({heavy} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "set()"


def test_version() -> None:
    assert metaros("--version").stdout.startswith("metaros ")


def test_no_arguments_show_the_help() -> None:
    assert "metaros COMMAND" in metaros().stdout + metaros().stderr


def test_a_typo_gets_a_hint_and_exit_code_2() -> None:
    done = metaros("topc")
    assert done.returncode == 2
    assert "Did you mean 'topic'" in done.stderr


@pytest.mark.parametrize(
    "command", ["up", "status", "doctor", "router", "topic", "topic echo", "topic pub", "node info"]
)
def test_every_command_has_its_own_help(command: str) -> None:
    done = metaros(*command.split(), "--help")
    assert done.returncode == 0
    assert "Usage" in done.stdout


def test_the_caller_s_fault_is_2_and_the_peer_s_is_1() -> None:
    assert exit_code(FieldError("x")) == 2
    assert exit_code(TimeoutError_("x")) == 1
    assert exit_code(MetarosError("x")) == 1


def test_an_error_is_one_line_and_what_to_do(free_port: int) -> None:
    done = metaros("topic", "list", "--zenoh-port", str(free_port))
    assert done.returncode == 1
    first, second = done.stderr.splitlines()
    assert first == f"error: no Zenoh router on 127.0.0.1:{free_port}"
    assert "metaros up" in second
    assert "metaros router" in second


def test_a_reader_that_goes_away_is_no_failure() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    try:
        done = subprocess.run(
            [sys.executable, "-m", "metaros", "interface", "list"], stdout=writer, stderr=subprocess.PIPE, text=True
        )
    finally:
        os.close(writer)
    assert done.stderr == ""
