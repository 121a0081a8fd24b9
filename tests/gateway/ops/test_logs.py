"""Log lines: one line each, harmless, with whose request it was."""

from __future__ import annotations

import asyncio
import json
import logging

from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.ops.logs import JsonFormatter, TextFormatter, add_log_context, log_context

FACTS = {"request_id": "ab12", "principal": "key:prometheus", "robot": "sim_1"}


def record(text: str, *args: object, error: BaseException | None = None) -> logging.LogRecord:
    info = (type(error), error, error.__traceback__) if error is not None else None
    return logging.LogRecord("gateway.test", logging.WARNING, __file__, 1, text, args, info)


def test_a_line_of_json_says_who_asked() -> None:
    with log_context(lambda: FACTS):
        line = json.loads(JsonFormatter().format(record("robot %s said %r", "sim_1", "hi")))
    assert line.pop("time").endswith("Z")
    assert line == {"level": "warning", "logger": "gateway.test", "message": "robot sim_1 said 'hi'", **FACTS}
    assert "request_id" not in json.loads(JsonFormatter().format(record("later")))


def test_a_line_of_text_says_it_too() -> None:
    with log_context(lambda: FACTS):
        line = TextFormatter().format(record("hm"))
    assert line.endswith("WARNING gateway.test: hm [request_id=ab12 principal=key:prometheus robot=sim_1]")
    assert TextFormatter().format(record("hm")).endswith("gateway.test: hm")


def test_an_error_comes_with_its_traceback() -> None:
    try:
        raise ValueError("evil\x1b[2J\nroot: all is well")
    except ValueError as error:
        line = JsonFormatter().format(record("failed", error=error))
    assert "\n" not in line
    assert "\x1b" not in line
    assert "ValueError: evil" in json.loads(line)["error"]


@settings(max_examples=50)
@given(st.text(st.characters(codec=None)), st.text(st.characters(codec=None)))
def test_whatever_a_name_holds_it_is_one_printable_line(text: str, name: str) -> None:
    with log_context(lambda: {"principal": name}):
        reported = JsonFormatter().format(record("%s", text))
        shown = TextFormatter().format(record("%s", text))
    assert reported.isprintable()
    assert json.loads(reported)["level"] == "warning"
    assert "\n" not in shown
    assert shown.isprintable()


async def test_tasks_know_their_own_requests() -> None:
    async def one(number: str) -> str:
        add_log_context(lambda: {"request_id": number})
        await asyncio.sleep(0)
        return json.loads(JsonFormatter().format(record("x")))["request_id"]  # type: ignore[no-any-return]

    assert await asyncio.gather(*(asyncio.create_task(one(str(n))) for n in range(5))) == list("01234")


def test_a_long_name_is_cut() -> None:
    with log_context(lambda: {"principal": "x" * 10_000}):
        assert len(JsonFormatter().format(record("hm"))) < 600
