"""The engine: who gets a worker, who waits, who is refused, and what is left when it ends."""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import json
import os
import signal
import time
from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio

from metaros.automation.functions.calls import FunctionSpec, Invocation
from metaros.automation.functions.errors import (
    ENGINE_FULL,
    RESERVED_FULL,
    EngineClosedError,
    RuntimeRefusedError,
    ThrottledError,
)
from metaros.automation.functions.launch import Confinement, Program, Usage, WorkerProcess, launch
from metaros.automation.functions.logs import LogPiece
from metaros.automation.functions.sandbox.level import Level
from metaros.automation.functions.zygote import Zygote
from metaros.errors import FieldError, LaunchError, TooLargeError
from metaros.limits import LIMITS
from tests.support.functions.functions import Bench, alive, running_engine
from tests.support.waiting import wait_until_async

PID = "import os\ndef handler(e, c):\n    return os.getpid()\n"
# Says that it runs, and goes on when it is told to.
HELD = """
import os, time
def handler(event, context):
    with open(event + ".pid", "w") as f: f.write(str(os.getpid()))
    while not os.path.exists(event): time.sleep(0.005)
    return os.getpid()
"""


pytestmark = pytest.mark.asyncio(loop_scope="module")


@pytest_asyncio.fixture(loop_scope="module")
async def bench(zygote: Zygote, tmp_path: Path) -> AsyncIterator[Bench]:
    async with engine(zygote, tmp_path, function_watch_s=0.05) as bench:
        yield bench


def engine(zygote: Zygote, folder: Path, **limits: Any) -> AbstractAsyncContextManager[Bench]:
    """One with limits of its own; the fork server is shared."""
    return running_engine(folder, launch=zygote.fork, limits=dataclasses.replace(LIMITS, **limits))


class Gate:
    """A call that is held in its handler."""

    def __init__(self, bench: Bench, spec: FunctionSpec, name: str) -> None:
        self.path = bench.shared / name
        self.task = asyncio.create_task(bench.invoke(spec, str(self.path)))

    def runs(self) -> bool:
        file = Path(f"{self.path}.pid")
        return file.exists() and file.read_text() != ""

    @property
    def pid(self) -> int:
        return int(Path(f"{self.path}.pid").read_text())

    async def open(self) -> Any:
        self.path.touch()
        outcome = await self.task
        assert outcome.ok, outcome
        return json.loads(outcome.payload)


async def held(bench: Bench, spec: FunctionSpec, name: str) -> Gate:
    gate = Gate(bench, spec, name)
    await wait_until_async(gate.runs)
    return gate


async def test_the_last_worker_works_next(bench: Bench) -> None:
    spec = bench.spec(HELD)
    first, second = await held(bench, spec, "a"), await held(bench, spec, "b")
    await first.open()
    await wait_until_async(lambda: bench.engine.status().pools[0].idle == 1)
    last = await second.open()
    for n in range(3):
        await wait_until_async(lambda: bench.engine.status().pools[0].idle == 2)
        gate = await held(bench, spec, f"c{n}")
        assert await gate.open() == last
    assert bench.engine.status().pools[0].workers == 2


async def test_busy_workers_are_joined_by_others_up_to_the_most(bench: Bench) -> None:
    spec = bench.spec(HELD, max_workers=2)
    gates = [await held(bench, spec, "a"), await held(bench, spec, "b"), Gate(bench, spec, "c")]
    assert bench.engine.room(spec) == 0
    await wait_until_async(lambda: bench.engine.status().pools[0].waiting == 1)
    assert (pool := bench.engine.status().pools[0]).workers == pool.busy == 2
    assert await gates[0].open() == await gates[2].open()
    await gates[1].open()


async def test_too_many_waiting_are_throttled(zygote: Zygote, tmp_path: Path) -> None:
    async with engine(zygote, tmp_path, function_waiting=1) as bench:
        spec = bench.spec(HELD, max_workers=1)
        gates = [await held(bench, spec, "a"), Gate(bench, spec, "b")]
        await wait_until_async(lambda: bench.engine.status().pools[0].waiting == 1)
        with pytest.raises(ThrottledError) as caught:
            await bench.invoke(spec, "c")
        assert caught.value.reason == ENGINE_FULL
        for gate in gates:
            await gate.open()


async def test_who_waits_too_long_is_throttled(zygote: Zygote, tmp_path: Path) -> None:
    async with engine(zygote, tmp_path, function_wait_s=0.2, function_watch_s=0.02) as bench:
        spec = bench.spec(HELD, max_workers=1)
        gate = await held(bench, spec, "a")
        with pytest.raises(ThrottledError):
            await bench.invoke(spec, "b")
        await gate.open()
        assert bench.engine.room(spec) == 1


async def test_reserved_concurrency_counts_all_versions(bench: Bench) -> None:
    one = bench.spec(HELD, name="n", reserved=1)
    two = bench.spec(PID, name="n", reserved=1)
    gate = await held(bench, one, "a")
    assert bench.engine.room(two) == 0
    with pytest.raises(ThrottledError) as caught:
        await bench.invoke(two)
    assert caught.value.reason == RESERVED_FULL
    await gate.open()
    assert bench.engine.room(two) == 1
    assert (await bench.invoke(two)).ok
    with pytest.raises(ThrottledError):
        await bench.invoke(bench.spec(PID, reserved=0))


async def test_calls_in_memory_are_bounded(zygote: Zygote, tmp_path: Path) -> None:
    async with engine(zygote, tmp_path, function_waiting_bytes=1000) as bench:
        with pytest.raises(ThrottledError):
            await bench.invoke(bench.spec(PID), "x" * 1000)
        assert (await bench.invoke(bench.spec(PID), "x" * 900)).ok
        assert (await bench.invoke(bench.spec(PID), "x" * 900)).ok


async def test_what_is_no_call(bench: Bench) -> None:
    table: list[tuple[dict[str, Any], type[Exception]]] = [
        ({"request_id": "a\r\nb: c"}, FieldError),
        ({"request_id": ""}, FieldError),
        ({"arn": "a\nb"}, FieldError),
        ({"trace_id": "grün"}, FieldError),
        ({"client_context": "{"}, FieldError),
        ({"client_context": json.dumps("x" * 20_000)}, FieldError),
        ({"payload": b"x" * (LIMITS.function_payload_bytes + 1)}, TooLargeError),
    ]
    for given, error in table:
        call = Invocation(**({"request_id": "r", "payload": b"1"} | given))
        with pytest.raises(error):
            await bench.engine.invoke(bench.spec(PID), call)
    assert bench.engine.status().pools == ()


async def test_other_runtimes_are_refused_by_name(bench: Bench) -> None:
    with pytest.raises(RuntimeRefusedError, match="nodejs22"):
        await bench.invoke(bench.spec(PID, runtime="nodejs22.x"))


async def test_a_worker_killed_while_idle(bench: Bench) -> None:
    spec = bench.spec(PID)
    pid = await bench.returned(spec)
    os.kill(pid, signal.SIGKILL)
    await wait_until_async(lambda: bench.engine.status().pools[0].workers == 0)
    assert await bench.returned(spec) != pid


async def test_a_worker_killed_while_it_works(bench: Bench) -> None:
    spec = bench.spec(HELD)
    gate = await held(bench, spec, "a")
    os.kill(gate.pid, signal.SIGKILL)
    outcome = await gate.task
    assert outcome.error_type == "Runtime.ExitError"
    assert "SIGKILL" in json.loads(outcome.payload)["errorMessage"]


async def test_a_fork_server_that_was_killed_is_replaced(tmp_path: Path) -> None:
    async with running_engine(tmp_path) as bench:
        spec = bench.spec(PID)
        pid = await bench.returned(spec)
        zygote = bench.engine._starter._zygote  # type: ignore[union-attr]
        assert zygote is not None
        os.kill(zygote.pid, signal.SIGKILL)
        await wait_until_async(lambda: not zygote.alive and not alive(pid))
        await wait_until_async(lambda: bench.engine.status().pools[0].workers == 0)
        assert await bench.returned(spec) != pid


async def test_closed_while_calls_run_and_wait(tmp_path: Path) -> None:
    async with running_engine(tmp_path) as bench:
        spec = bench.spec(HELD, max_workers=1)
        running, waiting = await held(bench, spec, "a"), Gate(bench, spec, "b")
        await wait_until_async(lambda: bench.engine.status().pools[0].waiting == 1)
        await bench.engine.close()
        for gate in (running, waiting):
            with pytest.raises(EngineClosedError):
                await gate.task
        with pytest.raises(EngineClosedError):
            await bench.invoke(spec)
        await wait_until_async(lambda: not alive(running.pid))  # killed with its keeper, who may be gone before it
        assert bench.engine.room(spec) == 0
        assert not (tmp_path / "engine" / "tmp").exists()


def with_word(word: str) -> list[int]:
    """Processes that have it on their command line."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):
            if word.encode() in path.read_bytes():
                found.append(int(path.parent.name))
    return found


@pytest.mark.parametrize("level", [None, Level.L1])
async def test_children_of_handlers_end_with_them(tmp_path: Path, level: Level | None) -> None:
    source = """
import subprocess, sys, time
def handler(word, c):
    subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)", word])
    if "slow" in word: time.sleep(600)
"""
    word = f"word{os.getpid()}{level}"
    async with running_engine(tmp_path, level=level) as bench:
        assert (await bench.invoke(bench.spec(source, timeout_s=0.5), word + "slow")).error_type == "Sandbox.Timeout"
        await wait_until_async(lambda: not with_word(word))
        assert (await bench.invoke(bench.spec(source), word)).ok
        await wait_until_async(lambda: with_word(word))
    await wait_until_async(lambda: not with_word(word))


async def test_a_retired_version_ends_its_calls_and_goes(bench: Bench) -> None:
    spec = bench.spec(HELD, max_workers=2)
    one, two = await held(bench, spec, "a"), await held(bench, spec, "b")
    await one.open()
    await bench.engine.retire(spec.key)
    await wait_until_async(lambda: not alive(one.pid))
    await two.open()
    await wait_until_async(lambda: not alive(two.pid) and bench.engine.status().pools == ())


async def test_warm_workers_are_there_before_the_first_call(bench: Bench) -> None:
    spec = bench.spec(
        "import os\ndef handler(e, c):\n    return os.environ['AWS_LAMBDA_INITIALIZATION_TYPE']\n", min_workers=2
    )
    await bench.engine.warm(spec)
    await wait_until_async(lambda: [p.workers for p in bench.engine.status().pools] == [2])
    outcome = await bench.invoke(spec)
    assert (outcome.init_ms, outcome.payload) == (0.0, b'"provisioned-concurrency"')
    await bench.engine.retire(spec.key)
    await wait_until_async(lambda: bench.engine.status().workers == 0)


async def test_warm_workers_that_fail_are_not_tried_without_end(bench: Bench) -> None:
    spec = bench.spec("import nothing_like_that", min_workers=1)
    began_s = time.monotonic()
    await bench.engine.warm(spec)
    await wait_until_async(lambda: bench.engine.status().pools[0].failures >= 1)
    assert bench.engine.status().pools[0].init_error == "Runtime.ImportModuleError"
    await asyncio.sleep(0.3)  # several looks of the watch, within the first second's pause
    assert bench.engine.status().pools[0].cold_starts <= 1 + (time.monotonic() - began_s)  # a second at least, each


async def test_idle_workers_go(zygote: Zygote, tmp_path: Path) -> None:
    async with engine(zygote, tmp_path, function_idle_s=0.1, function_watch_s=0.02) as bench:
        pid = await bench.returned(bench.spec(PID))
        await wait_until_async(lambda: not alive(pid))
        await wait_until_async(lambda: bench.engine.status().pools == ())


async def test_a_worker_is_replaced_after_its_calls(zygote: Zygote, tmp_path: Path) -> None:
    async with engine(zygote, tmp_path, function_calls=3) as bench:
        spec = bench.spec(PID, max_workers=1)
        pids = [await bench.returned(spec) for _ in range(7)]
        assert [len({*pids[at : at + 3]}) for at in (0, 3)] == [1, 1]
        assert len({*pids}) == 3


async def test_a_full_engine_takes_workers_from_who_idles(zygote: Zygote, tmp_path: Path) -> None:
    async with running_engine(tmp_path, launch=zygote.fork, most_workers=1) as bench:
        one, two = bench.spec(HELD), bench.spec(HELD)
        first = await held(bench, one, "a")
        second = Gate(bench, two, "b")
        await wait_until_async(lambda: [p.waiting for p in bench.engine.status().pools] == [0, 1])
        await first.open()
        await wait_until_async(second.runs)
        await second.open()
        assert bench.engine.status().workers == 1
        await (await held(bench, one, "c")).open()


async def test_a_slow_init_is_tried_once_more_within_the_timeout(zygote: Zygote, tmp_path: Path) -> None:
    source = """
import os, time
if not os.path.exists({flag!r}):
    open({flag!r}, "w").close()
    time.sleep(60)
def handler(e, c):
    return "up"
"""
    async with engine(zygote, tmp_path, function_init_s=0.5) as bench:
        spec = bench.spec(source.format(flag=str(bench.shared / "flag")))
        assert await bench.returned(spec) == "up"
        outcome = await bench.invoke(bench.spec("import time\ntime.sleep(60)", timeout_s=0.3))
        assert outcome.error_type == "Sandbox.Timeout"


async def test_no_process_is_an_outcome(tmp_path: Path) -> None:
    async def refuse(program: Program, confinement: Confinement) -> WorkerProcess:
        raise LaunchError("no room")

    async with running_engine(tmp_path, launch=refuse) as bench:
        outcome = await bench.invoke(bench.spec(PID))
        assert outcome.error_type == "Sandbox.Failure"
        assert "no room" in json.loads(outcome.payload)["errorMessage"]
        assert (await bench.invoke(bench.spec(PID))).error_type == "Sandbox.Failure"


async def test_a_start_without_fork_server(tmp_path: Path) -> None:
    async with running_engine(tmp_path, warm_start=False, launch=launch) as bench:
        assert await bench.returned(bench.spec("def handler(e, c): return e"), 5) == 5


async def test_closed_while_a_worker_starts(zygote: Zygote, tmp_path: Path) -> None:
    async with engine(zygote, tmp_path) as bench:
        spec = bench.spec("import time\ntime.sleep(600)\n")
        call = asyncio.create_task(bench.invoke(spec))
        await wait_until_async(lambda: [pool.starting for pool in bench.engine.status().pools] == [1])
        async with asyncio.timeout(LIMITS.function_init_s / 2):
            await bench.engine.close()
        with pytest.raises(EngineClosedError):
            await call


async def test_who_answers_and_asks_for_no_other_call_is_replaced(bench: Bench) -> None:
    source = """
import os, time
from metaros.automation.functions.runtime import runtime_client
def handler(stay, c):
    if stay: never_again()
    return os.getpid()
def never_again():
    post = runtime_client.Connection.post
    def once(*args, **options):
        post(*args, **options)
        time.sleep(600)
    runtime_client.Connection.post = once
"""
    spec = bench.spec(source, timeout_s=0.5, max_workers=1)
    stuck = await bench.returned(spec, True)
    assert await bench.returned(spec, False) != stuck
    await wait_until_async(lambda: not alive(stuck))


async def test_a_listener_that_fails_stops_nothing(bench: Bench, caplog: pytest.LogCaptureFixture) -> None:
    def broken(piece: LogPiece) -> None:
        raise ValueError("broken")

    bench.engine.on_log(broken)
    assert (await bench.invoke(bench.spec(PID))).ok
    assert "broken" in caplog.text


async def test_a_cancelled_call_goes_on(bench: Bench) -> None:
    spec = bench.spec(HELD, max_workers=1)
    gate = await held(bench, spec, "a")
    gate.task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await gate.task
    gate.path.touch()
    assert await (await held(bench, spec, "b")).open() == gate.pid


async def test_too_many_temporary_files(bench: Bench) -> None:
    source = """
import os, time
def handler(e, c):
    for i in range(e):
        with open(os.path.join(os.environ["TMPDIR"], str(i)), "wb") as f: f.write(b"x" * 1_000_000)
    time.sleep(e)
    return "written"
"""
    spec = bench.spec(source, disk_mb=5)
    outcome = await bench.invoke(spec, 10)
    assert outcome.error_type == "Sandbox.Failure"
    assert "5 MB" in json.loads(outcome.payload)["errorMessage"]
    await wait_until_async(lambda: not list((bench.folder / "engine" / "tmp").iterdir()))


async def test_a_call_does_not_pay_for_what_one_before_it_used(zygote: Zygote, tmp_path: Path) -> None:
    async with engine(zygote, tmp_path, function_watch_s=3600.0) as bench:
        spec = bench.spec(PID, memory_mb=100, max_workers=1)  # where the first is slow, another is started beside it
        pid = await bench.returned(spec)
        (worker,) = bench.engine._pools[spec.key].workers
        much, little = Usage(memory_bytes=101 << 20, disk_bytes=0), Usage(memory_bytes=1 << 20, disk_bytes=0)
        for seen in (much, little, much):  # each of the time before the call that it is told in
            worker.look(seen, calls=worker.calls - 1)
            assert await bench.returned(spec) == pid
        worker.look(much, calls=worker.calls - 1)  # but not for ever
        await wait_until_async(lambda: not alive(pid))
        other = await bench.returned(spec)
        (worker,) = bench.engine._pools[spec.key].workers
        worker.look(much, calls=worker.calls)
        await wait_until_async(lambda: not alive(other))


async def test_the_client_can_be_chosen_by_the_function(bench: Bench) -> None:
    source = "import sys\ndef handler(e, c):\n    return type(c).__module__\n"
    assert await bench.returned(bench.spec(source)) == "metaros.automation.functions.runtime.client_context"
    chosen = bench.spec(source, environment={"METAROS_RUNTIME_CLIENT": "awslambdaric"})
    assert await bench.returned(chosen) == "awslambdaric.lambda_context"
    assert [pool.entry for pool in bench.engine.status().pools] == ["metaros", "awslambdaric"]
