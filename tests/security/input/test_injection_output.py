"""Names from outside in logs, in what the command line prints, and in tables for spreadsheets."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import logging
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from metaros.cli.main import main
from metaros.cli.shared.output import Output
from metaros.cli.top.commands import _print as print_top
from metaros.cli.top.drops import DropRow
from metaros.cli.top.rows import NodeRow, Screenful, TopicRow
from metaros.cli.top.screen import render
from metaros.errors import TokenError
from metaros.interfaces.std_msgs.msg import String
from metaros.record import export_csv, export_json, open_bag
from metaros.sanitize import SanitizingFormatter, sanitize_json
from metaros.wire.liveliness_tokens import parse_token
from tests.security.input.test_injection import MARKUP, STRINGS
from tests.support.nodes.bags import arrivals, write_bag
from tests.support.servers.hostile_gateway import hostile_gateway

pytestmark = pytest.mark.integration

ALL = (*STRINGS, *MARKUP)
STYLE = re.compile(r"\x1b\[[\d;]*m")
LINE = re.compile(r"[0-9]{4}-[0-9]{2}-[0-9]{2} ")
TIME = "2026-11-21T06:00:00Z"

# What each program does before it serves, with the serving itself replaced by records that name what came.
LOGS = """
import json, logging, sys
texts = json.load(sys.stdin)

def tell():
    log = logging.getLogger("gateway.any")
    for text in texts:
        log.warning("robot %s sends %r on %s", text, text, text)
        try:
            raise ValueError(text)
        except ValueError:
            log.exception("user %s, path /%s", text, text, stack_info=True)
"""
GATEWAY = """
import gateway.main
from gateway.settings import Settings
from pathlib import Path

async def serve(*args, **more):
    tell()

gateway.main.serve = serve
gateway.main.run(Settings(data_dir=Path(sys.argv[1])))
"""
AGENT = """
import edge_agent.main
from metaros.cli.main import main
edge_agent.main.run = lambda settings: tell()
main(["agent", "--name", "r1", "--state-dir", sys.argv[1]])
"""


def facts(text: str) -> dict[str, Any]:
    """What a gateway could say about anything, with the text in every place that takes one."""
    certificate = {"not_after": text, "revoked": False}
    known: dict[str, Any] = {"number": 1, "at": text, "name": text, "kind": text, "address": text, "action": text}
    known |= {"target": text, "method": text, "status": 200, "code": text, "detail": text, "fault": text}
    known |= {"robot": text, "state": text, "enrolled": text, "certificates": [certificate], "alarm": text}
    known |= {"reason": text, "role": text, "robots": [text], "scopes": [text], "user": text, "id": text}
    known |= {"created": text, "expires": text, "used": text, "signed_in": text, "has_password": False}
    known |= {"external": False, "disabled": False, "topic": text, "type": text, "samples": 1, "bytes": 1}
    known |= {"first": TIME, "last": TIME, "start": TIME, "end": TIME, "messages": 1, "size_bytes": 0}
    return known | {"stamp": text, "message": {"data": text}, "url": text, "token": text, "command": text, "key": text}


MANY = [facts(text) for text in ALL]
LISTS = {
    ("audit", "list"): {"rows": MANY},
    ("robot", "identities"): {"identities": MANY},
    ("user", "list"): {"users": MANY},
    ("key", "list"): {"keys": MANY},
    ("recording", "list"): {"recordings": MANY},
    ("history", "topics", "r1"): {"topics": MANY, "series": 0},
    ("history", "messages", "r1"): {"messages": MANY, "next": None, "gaps": [{"count": 1, "reason": "\x1b[2J\n"}]},
}
SINGLE = {
    ("audit", "verify"): lambda text: (
        {"ok": True, "faults": [facts(text)], "heads_error": text, "heads": 1}
        | {"heads_sealed": 1, "rows": 1, "hash": text}
    ),
    ("robot", "token"): facts,
    ("user", "add", "x", "--role", "viewer"): facts,
    ("key", "create", "--name", "x", "--role", "viewer"): facts,
    ("signin",): facts,
    ("recording", "save", "r1", "--no-wait"): facts,
}


def metaros(url: str, *words: str) -> int:
    """A command, asked of that gateway; its exit code."""
    with pytest.raises(SystemExit) as ended:
        main([*words, "--gateway", url])
    return int(ended.value.code or 0)


@pytest.fixture(autouse=True)
def _home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("METAROS_KEY", "x")
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("program", [GATEWAY, AGENT], ids=["gateway", "agent"])
def test_a_log_has_a_line_for_each_record(program: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", LOGS + program, str(tmp_path / "own")],
        input=json.dumps(ALL).encode(),
        capture_output=True,
        timeout=120,
        env={**os.environ, "PYTHONIOENCODING": "utf-8", "METAROS_GATEWAY_URL": ""},
    )
    lines = done.stderr.decode().splitlines()
    assert done.returncode == 0, done.stderr
    assert sum(bool(LINE.match(line)) for line in lines) == 2 * len(ALL)
    assert [line for line in lines if not LINE.match(line) and not line.startswith("  ")] == []
    assert [line for line in done.stderr.decode().split("\n") if not line.isprintable()] == []


def test_a_record_is_one_line() -> None:
    formatter = SanitizingFormatter("%(levelname)s %(name)s %(message)s")
    records = (logging.LogRecord(text, logging.ERROR, text, 1, "robot %s", (text,), None) for text in STRINGS)
    shown = [formatter.format(record) for record in records]
    assert [line for line in shown if not (line.isprintable() and line.startswith("ERROR "))] == []


def unprintable(text: str) -> list[str]:
    """Lines that a terminal would obey."""
    return [line for line in text.split("\n") if not line.isprintable()]


@pytest.mark.parametrize("words", LISTS, ids=" ".join)
def test_a_list_has_a_row_for_each(
    words: tuple[str, ...], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    more = ("--limit", str(len(ALL))) if words[1] == "messages" else ()
    with hostile_gateway({"/": LISTS[words]}) as url:
        assert metaros(url, *words, *more) == 0
        said = capsys.readouterr()
        assert said.out.count("\n") == len(ALL)
        assert unprintable(said.out + said.err) == []

        assert metaros(url, *words, *more, "--output", "json") == 0
        said_json = capsys.readouterr().out
        assert unprintable(said_json) == []
        found = [json.loads(line) for line in said_json.strip().split("\n")]
        (found,) = found if len(found) == 1 else (found,)
        found = found["topics"] if isinstance(found, dict) else found
        assert sorted(map(str, found)) == sorted(map(str, MANY))

        monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
        monkeypatch.setenv("TERM", "xterm-256color")
        monkeypatch.delenv("NO_COLOR", raising=False)
        assert metaros(url, *words) == 0
        on_terminal = capsys.readouterr()
        assert unprintable(STYLE.sub("", on_terminal.out + on_terminal.err)) == []
        assert "\x1b[31m" not in on_terminal.out


@pytest.mark.parametrize("words", SINGLE, ids=" ".join)
def test_what_is_made_is_printed_harmless(words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    rows = {}
    answers: dict[str, Any] = {}
    with hostile_gateway(answers) as url:
        for text in (STRINGS[0], "a\nb", "a\r\nb", "\x9b2J", "\ud800", "\u202eb"):
            answers["/"] = SINGLE[words](text)
            assert metaros(url, *words) == 0
            said = capsys.readouterr()
            shown = said.out + said.err
            assert [line for line in shown.split("\n") if not line.isprintable()] == [], text
            rows[text] = shown.count("\n")
    assert len(set(rows.values())) == 1, rows


@pytest.mark.parametrize("status", [401, 404, 500])
def test_a_refusal_is_harmless(status: int, capsys: pytest.CaptureFixture[str]) -> None:
    answers: dict[str, Any] = {}
    texts = (*ALL[:12], *ALL[-22:])
    with hostile_gateway(answers, status=status) as url:
        for text in texts[(404, 401, 500).index(status) :: 3]:  # they are shared out: all are said the same way
            answers["/"] = {"detail": f"no {text}"}
            assert metaros(url, "audit", "list") != 0
            said = capsys.readouterr().err
            assert [line for line in said.split("\n") if not line.isprintable()] == [], ascii(text)
            assert said.startswith("error: no ")


def test_top_is_harmless(capsys: pytest.CaptureFixture[str]) -> None:
    screenful = Screenful(
        tuple(TopicRow(text, text, 1.0, 1.0, 1, 1) for text in ALL),
        tuple(NodeRow(text, 1, 1, 1, 5, 1.0) for text in ALL),
        0,
        tuple(DropRow(text, text, 1, 1, 1, 1, 1, 1, 1) for text in ALL),
    )
    print_top(Output(), screenful)
    plain = capsys.readouterr().out
    assert [line for line in plain.split("\n") if not line.isprintable()] == []
    assert plain.count("\n") == 3 * len(ALL) + 2
    screen = io.StringIO()
    Console(file=screen, force_terminal=True, width=400, height=2000).print(render(screenful, 2000))
    shown = STYLE.sub("", screen.getvalue())
    assert [line for line in shown.split("\n") if not line.isprintable()] == []
    assert "[bold red]rich[/]" in shown


def test_no_node_and_no_topic_of_the_graph_is_called_so() -> None:
    node = "@ros2_lv/0/0123456789abcdef/0/0/NN/%/%"
    assert parse_token(f"{node}/talker")
    taken = []
    for text in ALL:
        with contextlib.suppress(TokenError):
            taken.append(ascii(parse_token(f"{node}/{text}")))
    assert taken == []


def test_a_line_of_ours_keeps_its_colours_and_loses_those_of_others(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    out = Output()
    out.line(f"{out.style('good', '32')}\t\x1b[8m\x1b[2J\x9b1m")
    out.note("a\x1b[31mb\nc")
    said = capsys.readouterr()
    assert said.out == "\x1b[32mgood\x1b[0m\t\\x1b[8m\\x1b[2J\\x9b1m\n"
    assert said.err == "\x1b[2ma\\x1b[31mb\nc\x1b[0m\n"


def test_tables_for_spreadsheets_hold_no_formula(tmp_path: Path) -> None:
    texts = [text for text in (*ALL, "-1.5", "+7", "\t=1+1", "\r=1+1") if not set(text) & {"\0", "\ud800"}]
    write_bag(tmp_path / "in.mcap", arrivals("/a", [String(data=text) for text in texts]))
    export_csv(open_bag(tmp_path / "in.mcap").messages(), tmp_path / "out")
    with (tmp_path / "out" / "a.csv").open(newline="", encoding="utf-8") as file:
        cells = [row["data"] for row in csv.DictReader(file)]
    assert len(cells) == len(texts)
    for cell, text in zip(cells, texts, strict=True):
        assert cell in (text, f"'{text}")
        assert not cell.startswith(("=", "+1+", "-2+", "@", "\t", "\r"))
    assert {"-1.5", "+7"} <= set(cells)


def test_json_lines_are_harmless_and_say_the_same(tmp_path: Path) -> None:
    texts = [text for text in (*ALL, "\U000e0041", "\U0001f916") if not set(text) & {"\0", "\ud800"}]
    write_bag(tmp_path / "in.mcap", arrivals("/a", [String(data=text) for text in texts]))
    out = io.StringIO()
    export_json(open_bag(tmp_path / "in.mcap").messages(), out)
    lines = out.getvalue().strip("\n").split("\n")
    assert [line for line in lines if not line.isprintable()] == []
    assert [json.loads(line)["message"]["data"] for line in lines] == texts
    assert json.loads(sanitize_json(json.dumps("\ud800", ensure_ascii=False))) == "\ud800"
