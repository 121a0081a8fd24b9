"""What a handler may expect of its platform, on AWS's client of the Runtime API and on ours, at two sandbox levels.

The tests of a client and level share an engine; each has functions of its own.
"""

from __future__ import annotations

import asyncio
import base64
import json
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio

from metaros.automation.functions.environment import own_entry
from metaros.automation.functions.probe import probe
from metaros.automation.functions.sandbox.level import Level
from metaros.limits import LIMITS
from tests.support.functions.functions import Bench, running_engine

ECHO = "def handler(event, context):\n    return event\n"
CLIENTS = {
    "awslambdaric, best level": ("awslambdaric", None),
    "best level": ("metaros", None),
    "L1": ("metaros", Level.L1),
}
pytestmark = pytest.mark.asyncio(loop_scope="module")


@pytest_asyncio.fixture(params=list(CLIENTS), scope="module", loop_scope="module")
async def bench(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Bench]:
    entry, level = CLIENTS[request.param]
    if entry == "awslambdaric" and own_entry("auto") != "awslambdaric":
        pytest.skip("awslambdaric is not installed")
    if level is not None:
        reason = (await asyncio.to_thread(probe)).reasons[level]
        if reason != "ok":
            pytest.skip(f"{level.name}: {reason}")
    async with running_engine(tmp_path_factory.mktemp("bench"), entry=entry, level=level) as bench:
        yield bench


async def test_json_in_and_out(bench: Bench) -> None:
    event = {"text": "grüße 🤖", "list": [1, 2.5, None, True], "deep": {"a": {"b": []}}}
    assert await bench.returned(bench.spec(ECHO), event) == event


async def test_the_second_call_is_warm(bench: Bench) -> None:
    spec = bench.spec("import gc, os\non = gc.isenabled()\ndef handler(e, c):\n    return on, os.getpid()\n")
    first, second = await bench.invoke(spec), await bench.invoke(spec)
    assert first.payload == second.payload
    assert json.loads(first.payload)[0]  # also where the interpreter starts without
    assert first.init_ms > 0
    assert second.init_ms == 0
    assert "Init Duration" in first.log.decode()
    assert "Init Duration" not in second.log.decode()


async def test_an_exception(bench: Bench) -> None:
    spec = bench.spec("def handler(e, c):\n    inner()\ndef inner():\n    raise ValueError('no battery')\n")
    outcome = await bench.invoke(spec, request_id="its-id")
    document = json.loads(outcome.payload)
    assert outcome.error_type == "ValueError"
    assert document["errorMessage"] == "no battery"
    assert document["errorType"] == "ValueError"
    assert document["requestId"] == "its-id"
    assert [line.strip().split("\n")[1].strip() for line in document["stackTrace"]] == [
        "inner()",
        "raise ValueError('no battery')",
    ]
    assert "[ERROR] ValueError: no battery" in outcome.log.decode()
    assert (await bench.invoke(spec)).init_ms == 0, "the worker lives on"


async def test_an_error_at_init(bench: Bench) -> None:
    table = {
        ("def handler(e, c): pass", "nothing.handler"): "Runtime.ImportModuleError",
        ("import not_there", "app.handler"): "Runtime.ImportModuleError",
        ("def handler(e, c: pass", "app.handler"): "Runtime.UserCodeSyntaxError",
        ("def handler(e, c): pass", "app.other"): "Runtime.HandlerNotFound",
        ("def handler(e, c): pass", "handler"): "Runtime.MalformedHandlerName",
        ("def handler(e, c): pass", "sys.exit"): "Runtime.BuiltInModuleConflict",
        ("raise RuntimeError('at import')", "app.handler"): "RuntimeError",
    }
    for (source, handler), error_type in table.items():
        spec = bench.spec(source, handler=handler)
        outcome = await bench.invoke(spec)
        document = json.loads(outcome.payload)
        assert (outcome.error_type, document["errorType"]) == (error_type, error_type), (source, handler)
        assert document["errorMessage"]
        pool = bench.pool(spec)
        assert (pool.init_error, pool.workers, pool.failures) == (error_type, 0, 1)


async def test_exit_at_init(bench: Bench) -> None:
    outcome = await bench.invoke(bench.spec("import os\nos._exit(7)"))
    assert outcome.error_type == "Runtime.ExitError"
    assert "exit status 7" in json.loads(outcome.payload)["errorMessage"]


async def test_exit_in_the_handler(bench: Bench) -> None:
    for call, status in (("os._exit(3)", 3), ("sys.exit(4)", 4)):
        spec = bench.spec(f"import os, sys\ndef handler(e, c):\n    if e:\n        {call}\n    return 'well'\n")
        outcome = await bench.invoke(spec, True, request_id="its-id")
        assert outcome.error_type == "Runtime.ExitError"
        message = json.loads(outcome.payload)["errorMessage"]
        assert message == f"RequestId: its-id Error: Runtime exited with error: exit status {status}"
        assert await bench.returned(spec, False) == "well", "another worker takes its place"


async def test_a_timeout(bench: Bench) -> None:
    spec = bench.spec("import time\ndef handler(e, c):\n    print('on it')\n    time.sleep(e)\n", timeout_s=0.5)
    outcome = await bench.invoke(spec, 60)
    assert outcome.error_type == "Sandbox.Timeout"
    assert "Task timed out after 0.50 seconds" in json.loads(outcome.payload)["errorMessage"]
    assert "on it" in outcome.log.decode()
    assert outcome.duration_ms >= 500
    assert (await bench.invoke(spec, 0)).ok


async def test_the_largest_answer_and_one_byte_more(bench: Bench) -> None:
    spec = bench.spec("def handler(e, c):\n    return b'x' * e\n")
    most = LIMITS.function_response_bytes
    assert len((await bench.invoke(spec, most)).payload) == most
    outcome = await bench.invoke(spec, most + 1)
    assert outcome.error_type == "Function.ResponseSizeTooLarge"
    assert str(most) in json.loads(outcome.payload)["errorMessage"]
    assert len((await bench.invoke(spec, 10)).payload) == 10


async def test_big_payloads(bench: Bench) -> None:
    event = "ä" * 900_000
    assert await bench.returned(bench.spec(ECHO), event) == event


async def test_bytes_come_as_they_are(bench: Bench) -> None:
    outcome = await bench.invoke(bench.spec("def handler(e, c):\n    return bytes(range(256))\n"))
    assert outcome.payload == bytes(range(256))
    assert outcome.content_type == "application/unknown"


async def test_a_payload_that_is_no_utf_8(bench: Bench) -> None:
    outcome = await bench.invoke(bench.spec(ECHO), b'{"a": "\xff\xfe"}')
    assert outcome.error_type == "Runtime.UnmarshalError"


async def test_text_that_is_no_utf_8(bench: Bench) -> None:
    assert await bench.returned(bench.spec("def handler(e, c):\n    return 'a\\ud800'\n")) == "a\ud800"


async def test_what_is_no_json(bench: Bench) -> None:
    for value in ("object()", "{1, 2}", "b''.join", "[{'a': lambda: 0}]"):
        outcome = await bench.invoke(bench.spec(f"def handler(e, c):\n    return {value}\n"))
        assert outcome.error_type == "Runtime.MarshalError", value
        assert "Unable to marshal response" in json.loads(outcome.payload)["errorMessage"]


async def test_decimals(bench: Bench) -> None:
    source = "from decimal import Decimal\ndef handler(e, c):\n    return [Decimal('1.5'), Decimal(3)]\n"
    assert await bench.returned(bench.spec(source)) == [1.5, 3]


async def test_a_cause_of_a_mib(bench: Bench) -> None:
    spec = bench.spec("def handler(e, c):\n    raise ValueError('x' * e)\n")
    for size in (1_000_000, 2_000_000):
        outcome = await bench.invoke(spec, size)
        assert len(json.loads(outcome.payload)["errorMessage"]) == size


async def test_the_context(bench: Bench) -> None:
    source = """
def handler(event, context):
    return {
        "names": [context.function_name, context.function_version, context.memory_limit_in_mb],
        "call": [context.aws_request_id, context.invoked_function_arn],
        "logs": [context.log_group_name, context.log_stream_name],
        "left": context.get_remaining_time_in_millis(),
        "client": [context.client_context.custom, context.client_context.client.app_title, context.client_context.env],
        "identity": context.identity.cognito_identity_id,
        "w3c": context.w3c(),
    }
"""
    client = {"custom": {"a": "grün\n"}, "client": {"app_title": "t"}, "env": {}, "w3c": {"traceparent": "00-1"}}
    spec = bench.spec(source, name="named", version="7", memory_mb=192, timeout_s=9.0)
    reported = await bench.returned(spec, request_id="id-1", arn="arn:x", client_context=json.dumps(client))
    assert reported["names"] == ["named", "7", "192"]
    assert reported["call"] == ["id-1", "arn:x"]
    assert reported["logs"][0] == "/aws/lambda/named"
    assert "/[7]" in reported["logs"][1]
    assert 0 < reported["left"] <= 9000
    assert reported["client"] == [{"a": "grün\n"}, "t", {}]
    assert reported["identity"] is None
    assert reported["w3c"] == {"traceparent": "00-1"}


async def test_no_client_context(bench: Bench) -> None:
    source = "import os\ndef handler(e, c):\n    return [c.client_context, os.environ.get('_X_AMZN_TRACE_ID')]\n"
    spec = bench.spec(source)
    assert await bench.returned(spec) == [None, None]
    assert await bench.returned(spec, trace_id="Root=1-5") == [None, "Root=1-5"]
    assert await bench.returned(spec) == [None, None]


async def test_the_environment(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GATEWAY_SECRET", "s3cret")
    mine = {"MINE": "yes", "AWS_REGION": "eu-central-1"}
    spec = bench.spec("import os\ndef handler(e, c):\n    return dict(os.environ)\n", environment=mine)
    reported = await bench.returned(spec)
    assert reported["MINE"] == "yes"
    assert reported["AWS_REGION"] == "eu-central-1"
    assert reported["AWS_LAMBDA_FUNCTION_NAME"] == spec.name
    assert reported["_HANDLER"] == "app.handler"
    assert reported["TZ"] == ":UTC"
    assert reported["AWS_LAMBDA_INITIALIZATION_TYPE"] == "on-demand"
    assert reported["AWS_EXECUTION_ENV"].startswith("AWS_Lambda_metaros_"), "else AWS's client makes a thread a call"
    assert "AWS_LAMBDA_MAX_CONCURRENCY" not in reported
    assert "s3cret" not in json.dumps(reported)


async def test_layers_and_folders(bench: Bench, tmp_path: Path) -> None:
    layer = tmp_path / "layer"
    (layer / "python").mkdir(parents=True)
    (layer / "python" / "of_layer.py").write_text("VALUE = 'layered'\n")
    source = "import of_layer\nimport os\ndef handler(e, c):\n    return [of_layer.VALUE, os.path.exists('app.py')]\n"
    spec = bench.spec(source, layer_dirs=(layer,), handler="inner/app.handler")
    (spec.code_dir / "inner").mkdir()
    (spec.code_dir / "app.py").rename(spec.code_dir / "inner" / "app.py")
    (spec.code_dir / "app.py").write_text("")
    assert await bench.returned(spec) == ["layered", True]


async def test_the_log_of_a_call(bench: Bench) -> None:
    source = """
import logging, sys
print("at init")
def handler(e, c):
    print("printed")
    print("to stderr", file=sys.stderr)
    logging.warning("two\\nlines %d", 2)
    logging.info("not shown")
"""
    pieces = []
    end = bench.engine.on_log(pieces.append)
    spec = bench.spec(source)
    outcome = await bench.invoke(spec, request_id="its-id", tail=True)
    log = outcome.log.decode()
    for text in ("at init", "START RequestId: its-id Version: $LATEST", "printed", "to stderr", "two\nlines 2"):
        assert text in log
    assert "not shown" not in log
    assert log.index("START") < log.index("printed") < log.index("END RequestId: its-id") < log.index("REPORT")
    assert f"Memory Size: {spec.memory_mb} MB" in log
    assert "".join(p.text for p in pieces if p.request_id == "its-id") in log
    assert {(p.function, p.version) for p in pieces} == {(spec.name, "$LATEST")}
    end()
    count = len(pieces)
    assert "at init" not in (await bench.invoke(spec)).log.decode()
    assert len(pieces) == count


async def test_logs_as_json(bench: Bench) -> None:
    source = """
import logging
def handler(e, c):
    logging.getLogger("mine").info("hello", extra={"robot": "r1"})
    logging.debug("not shown")
"""
    spec = bench.spec(source, environment={"AWS_LAMBDA_LOG_FORMAT": "JSON", "AWS_LAMBDA_LOG_LEVEL": "INFO"})
    log = (await bench.invoke(spec, request_id="its-id")).log.decode()
    (line,) = [json.loads(line) for line in log.splitlines() if line.startswith("{")]
    assert (line["level"], line["message"], line["logger"], line["robot"]) == ("INFO", "hello", "mine", "r1")
    assert line["requestId"] == "its-id"


async def test_the_tail_is_the_end_and_bounded(bench: Bench) -> None:
    outcome = await bench.invoke(bench.spec("def handler(e, c):\n    for i in range(5000): print('line', i)\n"))
    assert len(outcome.log) == LIMITS.function_tail_bytes
    assert b"line 4999\n" in outcome.log
    assert outcome.log.endswith(b" MB\n") or b"Init Duration" in outcome.log.splitlines()[-1]


async def test_a_log_without_end_is_cut_and_stops_nobody(bench: Bench) -> None:
    pieces = []
    end = bench.engine.on_log(pieces.append)
    source = "def handler(e, c):\n    for i in range(20): print('x' * 100_000)\n    return 'done'\n"
    assert await bench.returned(bench.spec(source)) == "done"
    end()
    text = "".join(piece.text for piece in pieces)
    assert len(text) < LIMITS.function_call_log_bytes + 200_000
    assert "the rest is dropped" in text
    assert "REPORT" in text


async def test_too_much_memory(bench: Bench) -> None:
    source = """
import time
def handler(e, c):
    held = []
    for _ in range(100 if e else 0):
        held.append(bytearray(b"x" * 16_000_000))
        time.sleep(0.02)
    return "held"
"""
    spec = bench.spec(source, memory_mb=128)
    outcome = await bench.invoke(spec, True)
    assert outcome.error_type in ("MemoryError", "Runtime.OutOfMemory", "Runtime.ExitError")
    assert await bench.returned(spec, False) == "held"


async def test_memory_is_reported(bench: Bench) -> None:
    source = "def handler(e, c):\n    global held\n    held = bytearray(b'x' * 40_000_000)\n"
    assert (await bench.invoke(bench.spec(source, memory_mb=256))).max_memory_mb >= 40


async def test_many_calls_at_a_time(bench: Bench) -> None:
    spec = bench.spec("import os\ndef handler(e, c):\n    return [e, c.aws_request_id]\n", max_workers=3)
    reported = await asyncio.gather(*(bench.returned(spec, n, request_id=f"call-{n}") for n in range(200)))
    assert reported == [[n, f"call-{n}"] for n in range(200)]


async def test_a_stream_of_one_piece(bench: Bench) -> None:
    pieces, outcome = await bench.stream(bench.spec(ECHO), {"a": 1})
    assert json.loads(pieces) == {"a": 1}
    assert outcome.ok
    assert outcome.payload == b""


async def test_a_stream_that_fails_at_once(bench: Bench) -> None:
    pieces, outcome = await bench.stream(bench.spec("def handler(e, c):\n    raise KeyError('k')\n"))
    assert pieces == b""
    assert outcome.error_type == "KeyError"
    assert json.loads(outcome.payload)["errorType"] == "KeyError"


async def test_the_context_has_a_log_and_the_rest_of_base64(bench: Bench) -> None:
    source = "import base64\ndef handler(e, c):\n    c.log('by hand\\n')\n    return base64.b64encode(b'x').decode()\n"
    outcome = await bench.invoke(bench.spec(source))
    assert base64.b64decode(json.loads(outcome.payload)) == b"x"
    assert b"by hand" in outcome.log
