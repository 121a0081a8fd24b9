"""`metaros function init` and `test`: a function begun from a template, and run here, without a gateway."""

from __future__ import annotations

import asyncio
import json
import shutil
import tempfile
from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated, Any

import typer

from gateway.cli.function.deploy import Handler, Source
from gateway.cli.function.invoke import Data, Event
from gateway.cli.function.json_input import payload_of, variables
from gateway.cli.function.manifest import handler_of, read_manifest
from gateway.cli.function.pack import pack
from gateway.cli.function.view import show_outcome
from gateway.cli.time_span import span_s
from metaros.automation.functions.calls import FunctionSpec, Invocation, Outcome
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output
from metaros.clock import SystemClock
from metaros.errors import UsageError

__all__ = ["TEMPLATES", "register", "run_here"]

TEMPLATES = {
    "hello": "the smallest one: it answers, and prints what it was told",
    "alert_to_webhook": "an alert becomes a message in a chat (Slack and those that read its format)",
    "image_to_s3": "pictures of a robot's camera go to a bucket of S3, by boto3",
    "battery_low_dock": "a robot whose battery runs low drives to its dock",
}
ARN = "arn:aws:lambda:local:000000000000:function:"
TIMED_OUT = "Sandbox.Timeout"


def register(noun: typer.Typer) -> None:
    """Add the verbs to the noun."""
    noun.command("init")(_init)
    noun.command("test")(_test)


def _init(
    template: Annotated[str, typer.Argument(metavar="TEMPLATE", help="As --list shows them.")] = "hello",
    folder: Annotated[Path | None, typer.Argument(metavar="FOLDER", help="Default: named as the template.")] = None,
    every: Annotated[bool, typer.Option("--list", help="Which templates there are.")] = False,
    output: FormatOption = Format.TEXT,
) -> None:
    """Begin a function from a template: its code, its rules, and how to go on."""
    out = Output(output)
    if every:
        rows = [{"name": name, "what": what} for name, what in TEMPLATES.items()]
        out.listing(("Template", "What it does"), rows, lambda item: (item["name"], item["what"]))
        return
    if template not in TEMPLATES:
        raise UsageError(f"there is no template {template}; there are {', '.join(TEMPLATES)}")
    target = folder or Path(template)
    if target.exists() and any(target.iterdir() if target.is_dir() else [target]):
        raise UsageError(f"{target} is there already\ngive another FOLDER")
    with as_file(files("gateway.automation") / "function_templates" / template) as source:
        shutil.copytree(source, target, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
    made = sorted(path.name for path in target.iterdir())
    if out.json:
        out.objects({"folder": str(target), "files": made})
        return
    for name in made:
        out.line(f"{target / name}")
    out.note(f"try it    metaros function test {target}")
    out.note(f"use it    metaros function deploy {target}")


def _test(
    source: Source,
    data: Data = "",
    event: Event = "",
    handler: Handler = "",
    timeout: Annotated[str, typer.Option("--timeout", metavar="SPAN", help="Of a call: 10s, 5m.")] = "",
    memory: Annotated[int, typer.Option("--memory", metavar="MB", help="Of a worker, 128 or more.")] = 0,
    env: Annotated[
        list[str] | None, typer.Option("--env", metavar="NAME=VALUE", help="A variable; may be repeated.")
    ] = None,
    output: FormatOption = Format.TEXT,
) -> None:
    """Run a function here as a gateway would: packed, shut in, called once. No gateway is needed."""
    out, payload = Output(output), payload_of(data, event)
    said, packed = read_manifest(source), pack(source)
    name = str(said.get("name") or source.resolve().stem)
    settings: dict[str, Any] = {
        "handler": handler or said.get("handler") or handler_of(packed, source),
        "environment": {**said.get("environment", {}), **variables(env or [])},
        "timeout_s": span_s(timeout, "--timeout") if timeout else float(said.get("timeout_s", 3.0)),
        "memory_mb": memory or said.get("memory_mb", 128),
    }
    outcome, level = asyncio.run(run_here(packed.data, name, json.dumps(payload).encode(), settings))
    done = _view(outcome)
    if out.json:
        out.objects({**done, "level": level})
    else:
        show_outcome(out, done, tail=True)
        out.note(f"sandbox {level}, as a gateway on this machine would run it")
    if not outcome.ok:
        raise typer.Exit(1)


async def run_here(data: bytes, name: str, payload: bytes, settings: dict[str, Any]) -> tuple[Outcome, str]:
    """Run packed code once in an engine of its own; what came of it, and the level of the sandbox."""
    from metaros.automation.functions.engine import Engine
    from metaros.automation.functions.package import discard

    clock = SystemClock()
    with tempfile.TemporaryDirectory(prefix="metaros-function-") as temporary:
        folder = Path(temporary)
        code = _unpacked(data, folder)
        engine = Engine(folder / "engine", clock=clock)
        await engine.start()
        try:
            arn = f"{ARN}{name}"
            spec = FunctionSpec(key=name, name=name, version="$LATEST", arn=arn, code_dir=code, **settings)
            call = Invocation(request_id=f"test-{clock.wall_ns()}", payload=payload, arn=arn, tail=True)
            outcome = await engine.invoke(spec, call)
            return outcome, engine.status().level.name
        finally:
            await engine.close()
            discard(code)


def _unpacked(data: bytes, folder: Path) -> Path:
    from metaros.automation.functions.package import check_zip, unpack

    folder.chmod(0o755)  # workers are other users where this one is root
    check_zip(data)
    (folder / "code.zip").write_bytes(data)
    return unpack(folder / "code.zip", folder / "code")


def _view(outcome: Outcome) -> dict[str, Any]:
    """As the gateway's API has it."""
    try:
        payload = json.loads(outcome.payload) if outcome.payload else None
    except ValueError:
        payload = outcome.payload.decode("utf-8", "replace")
    failed = "timeout" if outcome.error_type == TIMED_OUT else "error"
    return {
        "status": "ok" if outcome.ok else failed,
        "payload": payload,
        "error_type": outcome.error_type,
        "duration_ms": outcome.duration_ms,
        "init_ms": outcome.init_ms,
        "max_memory_mb": outcome.max_memory_mb,
        "log": outcome.log.decode("utf-8", "replace"),
        "version": "",
    }
