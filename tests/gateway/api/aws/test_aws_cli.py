"""The unmodified `aws` command line: a function is made, changed, published, given an alias, called, and mapped.

Its own program runs what `shell=True` says; the rest its own code does in one process, whose imports are paid for once.
"""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.support.gateways.aws_cli import aws_command
from tests.support.gateways.lambda_gateway import ROLE, LambdaGateway, zipped
from tests.support.processes.processes import started

pytestmark = pytest.mark.integration

Run = Callable[..., Any]
# What the program does, as often as a line comes: a fresh driver each time, and the arguments where it looks for them.
COMMANDS = """
import contextlib, io, json, sys
import awscli.clidriver
for line in sys.stdin:
    sys.argv = ["aws", *json.loads(line)]
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in range(2))
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = awscli.clidriver.main()
    print(json.dumps([code, *(text.buffer.getvalue().decode() for text in (out, err))]), flush=True)
"""


@pytest.fixture(scope="module")
def run(served: LambdaGateway, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """`aws lambda …`: what it writes, or the end of what it complains about."""
    command, folder = aws_command(), tmp_path_factory.mktemp("aws")
    key_id, secret = served.key()
    environment = {
        **{name: value for name, value in os.environ.items() if not name.startswith(("AWS_", "COV_"))},
        "AWS_ACCESS_KEY_ID": key_id,
        "AWS_SECRET_ACCESS_KEY": secret,
        "AWS_DEFAULT_REGION": "eu-central-1",
        "AWS_ENDPOINT_URL_LAMBDA": served.endpoint,
        "AWS_CONFIG_FILE": str(folder / "config"),
        "AWS_SHARED_CREDENTIALS_FILE": str(folder / "credentials"),
        "NO_PROXY": "127.0.0.1",
    }

    def by_itself(words: list[str]) -> list[Any]:
        done = subprocess.run(
            [command, *words], env=environment, cwd=folder, capture_output=True, text=True, timeout=120
        )
        return [done.returncode, done.stdout, done.stderr]

    argv = [str(command.with_name("python")), "-u", "-c", COMMANDS]
    with started(argv, env=environment, cwd=folder, stdin=subprocess.PIPE) as process:

        def ran(*words: str, fails: bool = False, shell: bool = False) -> Any:
            code, out, err = by_itself(["lambda", *words]) if shell else reported(process, ["lambda", *words])
            assert bool(code) is fails, err
            return err if fails else json.loads(out or "null")

        yield ran


def reported(process: subprocess.Popen[str], words: list[str]) -> list[Any]:
    """Exit code, output and complaints of a command that the process was told to do."""
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(f"{json.dumps(words)}\n")
    process.stdin.flush()
    line = process.stdout.readline()
    assert line, process.communicate()
    answer: list[Any] = json.loads(line)
    return answer


def test_the_life_of_a_function(run: Run, tmp_path: Path) -> None:
    code, answer = tmp_path / "code.zip", tmp_path / "answer.json"
    code.write_bytes(zipped("def handler(event, context):\n    return {'one': event}\n"))
    named = ("--function-name", "tool")
    what = ("--runtime", "python3.12", "--handler", "app.handler", "--role", ROLE, "--zip-file", f"fileb://{code}")
    made = run(
        "create-function", *named, *what, "--environment", "Variables={MODE=fast}", "--tags", "team=robots", shell=True
    )
    assert (made["State"], made["Environment"]) == ("Active", {"Variables": {"MODE": "fast"}})
    run("wait", "function-active-v2", *named)
    call = ("invoke", *named, "--payload", '{"a": 1}', str(answer))
    assert run(*call)["StatusCode"] == 200
    assert json.loads(answer.read_text()) == {"one": {"a": 1}}
    code.write_bytes(zipped("def handler(event, context):\n    return 2\n"))
    run("update-function-code", *named, "--zip-file", f"fileb://{code}")
    run("update-function-configuration", *named, "--timeout", "9", "--memory-size", "256")
    run("wait", "function-updated", *named)
    assert run("publish-version", *named)["Version"] == "1"
    alias = run("create-alias", *named, "--name", "live", "--function-version", "1")
    assert alias["AliasArn"].endswith(":tool:live")
    called = run(*call, "--qualifier", "live", "--log-type", "Tail")
    assert (called["ExecutedVersion"], json.loads(answer.read_text())) == ("1", 2)
    assert called["LogResult"]
    assert run(*call, "--invocation-type", "Event")["StatusCode"] == 202
    assert [item["FunctionName"] for item in run("list-functions")["Functions"]] == ["tool"]
    run("put-function-concurrency", *named, "--reserved-concurrent-executions", "3")
    assert run("get-function", *named)["Concurrency"] == {"ReservedConcurrentExecutions": 3}


def test_a_topic_is_mapped_to_a_function(run: Run, tmp_path: Path) -> None:
    code = tmp_path / "code.zip"
    code.write_bytes(zipped())
    named = ("--function-name", "heard")
    what = ("--runtime", "python3.12", "--handler", "app.handler", "--role", ROLE, "--zip-file", f"fileb://{code}")
    run("create-function", *named, *what)
    source = "arn:aws:metaros:::topic/*/battery_state"
    made = run("create-event-source-mapping", *named, "--event-source-arn", source, "--batch-size", "5")
    (found,) = run("list-event-source-mappings", *named)["EventSourceMappings"]
    assert (found["UUID"], found["BatchSize"], found["State"]) == (made["UUID"], 5, "Enabled")
    run("delete-event-source-mapping", "--uuid", made["UUID"])
    run("delete-function", *named)
    assert "ResourceNotFoundException" in run("get-function", *named, fails=True, shell=True)
    assert "not implemented by Meta-ROS" in run("list-code-signing-configs", fails=True)
