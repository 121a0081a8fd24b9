"""Names with control codes, markup and formulas: on a terminal and in a pipe they are text, one row each."""

from __future__ import annotations

import sys

import pytest

from gateway.domain.robot import is_robot_id
from gateway.errors import InvalidRequestError, ProtocolError
from gateway.ingest.handshake import read_channel
from metaros.cli.shared.output import Output, sanitize
from metaros.limits import LIMITS
from tests.gateway.harness import channel

STRINGS = (
    *(
        f"\x1b{code}evil"
        for code in ("[2J", "[31m", "]0;title\x07", "]8;;http://x\x07", "[1A", "[?1049h", "P$q", "_G", "c", "(0")
    ),
    *(f"a{char}b" for char in map(chr, (*range(0x20), 0x7F, 0x85, 0x9B, 0x9D, 0xAD))),
    *(f"a{char}b" for char in "\u2028\u2029\u202e\u202d\u2066\u2069\u200b\u200e\ufeff\ue000"),
    "a\r\nINFO signed in as admin",
    "a\nsim_2  online",
    "\ud800",
    "a\x08\x08\x08b",
)  # fmt: skip
MARKUP = (
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "=cmd()|' /C calc'!A0",
    "+1+1",
    "-2+3",
    "@SUM(1)",
    "javascript:alert(1)",
    "{{7*7}}",
    "${7*7}",
    "%s%n",
    "[bold red]rich[/]",
    "'; DROP TABLE robots; --",
    "&lt;b&gt;",
    "`id`",
    "$(id)",
)


def test_there_are_enough_strings() -> None:
    assert len({*STRINGS, *MARKUP}) >= 50


def test_control_codes_are_written_out_and_what_is_printable_stays() -> None:
    wrong = [ascii(text) for text in STRINGS if not sanitize(text).isprintable() or sanitize(text) == text]
    wrong += [ascii(text) for text in STRINGS if sanitize(sanitize(text)) != sanitize(text)]
    wrong += [text for text in ("sim_1", "Grüße", "🤖", "日本", *MARKUP) if sanitize(text) != text]
    assert wrong == []


def test_a_table_and_a_list_have_a_row_for_each_name(capsys: pytest.CaptureFixture[str]) -> None:
    Output().table(["NAME", "STATE"], [(text, "online") for text in (*STRINGS, *MARKUP)])
    Output().names([*STRINGS, *MARKUP])
    shown = capsys.readouterr().out
    assert len(shown.split("\n")) == 2 * len((*STRINGS, *MARKUP)) + 1
    assert all(line.isprintable() for line in shown.split("\n"))


def test_a_table_on_a_terminal_is_harmless_too(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    Output().table(["NAME"], [(text,) for text in (*STRINGS, *MARKUP)])
    shown = capsys.readouterr().out
    assert "[bold red]rich[/]" in shown
    assert not any("\x1b" in line and "evil" in line for line in shown.splitlines())
    assert "\x07" not in shown


def test_no_robot_and_no_topic_is_called_so() -> None:
    names = [*STRINGS[:-3], *MARKUP]
    assert [ascii(text) for text in names if is_robot_id(text) or takes_topic(f"/{text}")] == []
    assert takes_topic("/odom")


def takes_topic(topic: str) -> bool:
    """Whether a robot may announce a channel of that name."""
    try:
        said = channel(1, topic, "std_msgs/msg/String")
    except ValueError:  # protobuf takes no surrogates
        return False
    try:
        read_channel("r1", said, limits=LIMITS)
    except (ProtocolError, InvalidRequestError):
        return False
    return True
