"""The program: version, help, errors, exit codes, pipes."""

from __future__ import annotations

import os
import subprocess
import sys

from metaros.cli.main import exit_code
from metaros.cli.nouns import NounCommands
from metaros.errors import FieldError, MetarosError, TimeoutError_
from tests.support.processes.command_line import call_metaros, program
from tests.support.processes.processes import END_S, started


def test_help_names_every_noun() -> None:
    page = call_metaros("--help").out
    nouns = "up status doctor router topic node service action param interface graph top sim play driver"
    for noun in nouns.split():
        assert f"\n    {noun} " in page
    assert "\x1b" not in page


def test_help_loads_nothing_heavy() -> None:
    pages: list[tuple[list[str], set[str]]] = [
        (["--help"], {"numpy", "rich", "zenoh", "grpc", "fastapi"}),
        (["agent", "--help"], {"numpy", "zenoh", "grpc", "fastapi"}),
        (["gateway", "--help"], {"numpy", "zenoh", "grpc", "fastapi"}),
    ]
    code = f"""
import sys
from metaros.cli.main import main
for arguments, heavy in {pages}:
    try: main(arguments)
    except SystemExit: pass
    print(arguments, sorted(heavy & set(sys.modules)), file=sys.stderr)
"""
    with started([sys.executable, "-c", code]) as process:
        _, err = process.communicate(timeout=END_S)
    assert err.splitlines() == [f"{arguments} []" for arguments, _ in pages]


def test_version() -> None:
    assert call_metaros("--version").out.startswith("metaros ")


def test_no_arguments_show_the_help() -> None:
    done = call_metaros()
    assert "metaros COMMAND" in done.out + done.err


def test_a_typo_gets_a_hint_and_exit_code_2() -> None:
    done = call_metaros("topc")
    assert done.code == 2
    assert "Did you mean 'topic'" in done.err


def test_every_command_has_its_own_help() -> None:
    pages = {words: call_metaros(*words.split(), "--help") for words in (*NounCommands(), "topic echo", "node info")}
    assert {"up", "status", "doctor", "router", "topic", "gateway", "agent"} <= pages.keys()
    assert [words for words, page in pages.items() if page.code or f"Usage: metaros {words} " not in page.out] == []


def test_the_caller_s_fault_is_2_and_the_peer_s_is_1() -> None:
    assert exit_code(FieldError("x")) == 2
    assert exit_code(TimeoutError_("x")) == 1
    assert exit_code(MetarosError("x")) == 1


def test_an_error_is_one_line_and_what_to_do(free_port: int) -> None:
    with started(program("topic", "list", "--zenoh-port", str(free_port))) as process:
        _, err = process.communicate(timeout=END_S)
    assert process.returncode == 1
    first, second = err.splitlines()
    assert first == f"error: no Zenoh router on 127.0.0.1:{free_port}"
    assert "metaros up" in second
    assert "metaros router" in second


def test_a_reader_that_goes_away_is_no_failure() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    try:
        done = subprocess.run(program("interface", "list"), stdout=writer, stderr=subprocess.PIPE, text=True)
    finally:
        os.close(writer)
    assert done.stderr == ""
