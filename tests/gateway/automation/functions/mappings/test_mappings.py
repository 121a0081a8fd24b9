"""Event source mappings on real stores: what robots' topics hold comes in batches, in order, and none is lost."""

from __future__ import annotations

import base64
import random  # noqa: TID251 - seeded
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import orjson
import pytest

from gateway.automation.functions.directory import EventInvoke, MappingRow
from gateway.automation.functions.mappings.batch_run import BatchRunner
from gateway.automation.functions.mappings.mappings import Mappings
from gateway.domain.automation.delivery import Put
from gateway.store import Store
from gateway.store.automation.deliveries import put
from gateway.store.automation.mapping_cursors import Stream
from gateway.store.engine import StoreEngine
from gateway.store.retention import Retention
from gateway.store.writes import Committed, StreamWrite
from metaros.automation.functions.calls import FunctionSpec, Invocation, Outcome
from metaros.automation.functions.errors import ThrottledError
from metaros.cdr import codec
from metaros.clock import ManualClock
from metaros.interfaces.std_msgs.msg import String
from tests.gateway.automation.functions.calling import FakeDirectory, FakeEngine, failed, make_invoker, returned
from tests.gateway.store.samples import EPOCH, run_write
from tests.support.servers.databases import on_both

ROW = MappingRow(uuid="m-1", source_arn="arn:aws:metaros:::topic/r*/events", function="f")
Act = Callable[[FunctionSpec, Invocation], Awaitable[Outcome]]


async def goes(spec: FunctionSpec, call: Invocation) -> Outcome:
    """Always."""
    return returned()


@dataclass(slots=True)
class Scene:
    """A store, a function and mappings that read for it."""

    store: Store
    clock: ManualClock
    engine: FakeEngine
    directory: FakeDirectory
    mappings: Mappings
    make: Callable[[], Mappings]
    told: list[Put] = field(default_factory=list)

    async def write(
        self, first_seq: int, *texts: str, robot: str = "r1", topic: str = "/events", stream: int = 7
    ) -> None:
        """Messages come in, and their commit is told."""
        payloads = [payload(text) for text in texts]
        write = run_write(first_seq, payloads, robot=robot, topic=topic, stream_id=stream)
        self.store.submit(write)
        await self.store.flush()
        self.mappings.on_committed(streams(Committed([write], [])))

    async def drive(self, seconds: float = 0.0) -> None:
        """Some time later, until nothing is due."""
        self.clock.advance(seconds)
        before = -1
        while before != len(self.engine.calls):
            before = len(self.engine.calls)
            for _ in range(3):  # a look that finds nothing new ends a stream's turn
                await self.mappings.step()
                await self.mappings.settle()

    def batches(self) -> list[list[str]]:
        """The texts of each call."""
        return [texts_of(call.payload) for _, call in self.engine.calls]

    def again(self) -> None:
        """The gateway died, and is back."""
        self.mappings = self.make()


def payload(text: str) -> bytes:
    """A message as a robot sends it."""
    return bytes(codec(String).encode(String(data=text)))


def streams(done: Committed) -> list[tuple[Stream, str]]:
    """As the wiring tells it."""
    return [
        (Stream(write.robot, write.stream_id, write.epoch), write.run.channel.topic)
        for write in done.writes
        if isinstance(write, StreamWrite) and write.run is not None
    ]


def texts_of(event: bytes) -> list[str]:
    """What the function reads in its records."""
    records = orjson.loads(event)["Records"]
    return [orjson.loads(base64.b64decode(item["kinesis"]["data"]))["detail"]["message"]["data"] for item in records]


def ids_of(event: bytes) -> list[str]:
    """The sequence numbers of its records."""
    return [item["kinesis"]["sequenceNumber"] for item in orjson.loads(event)["Records"]]


@pytest.fixture
async def scene(store_url: str, tmp_path: Path) -> AsyncIterator[Scene]:
    """A function `f` and one mapping onto the events of robots whose names begin with r."""
    clock = ManualClock()
    retention = Retention(age_s=1e9, size_bytes=1 << 50)
    store = Store(tmp_path, clock=clock, retention=retention, queue_bytes=1 << 26, url=store_url)
    store.start()
    engine, directory = FakeEngine(act=goes), FakeDirectory(functions={"f": EventInvoke()}, rows=[ROW])

    async def accept(puts: Sequence[Put]) -> Sequence[str]:
        return [""] * len(puts)

    def keep(store_engine: StoreEngine, puts: Sequence[Put]) -> object:
        return put(store_engine, puts, gateway=store.gateway_id, now_ns=clock.wall_ns())

    invoker, _ = make_invoker(store, engine, directory, accept, clock=clock)

    def make() -> Mappings:
        batch_runner = BatchRunner(store, invoker, put=keep, clock=clock)
        return Mappings(store, directory, batch_runner, notify=scene.told.extend, clock=clock)

    scene = Scene(store, clock, engine, directory, mappings=None, make=make)  # type: ignore[arg-type]
    scene.mappings = make()
    await scene.drive()
    yield scene
    await store.close()


def remap(scene: Scene, **changes: Any) -> None:
    """The mapping is another one."""
    scene.directory.rows[:] = [replace(scene.directory.rows[0], **changes)]
    for listener in scene.directory.listeners:
        listener("")


async def test_messages_come_in_batches_with_what_handlers_expect(scene: Scene) -> None:
    remap(scene, batch_size=2)
    await scene.drive()
    await scene.write(1, "a", "b", "c")
    await scene.drive()
    assert scene.batches() == [["a", "b"], ["c"]]
    (record, _) = orjson.loads(scene.engine.calls[0][1].payload)["Records"]
    assert record["eventSourceARN"] == ROW.source_arn
    assert record["kinesis"]["partitionKey"] == "r1"
    assert record["kinesis"]["sequenceNumber"] == f"r1/7/{EPOCH}/1"
    await scene.drive(60)
    assert len(scene.engine.calls) == 2
    assert scene.directory.results == {"m-1": "OK"}


async def test_other_robots_and_topics_are_none_of_its_business(scene: Scene) -> None:
    await scene.write(1, "x", robot="other")
    await scene.write(1, "y", topic="/else", stream=8)
    await scene.drive(5)
    assert scene.engine.calls == []


@on_both
async def test_what_was_stored_before_comes_only_where_it_is_asked_for(scene: Scene) -> None:
    scene.directory.rows.clear()
    remap_listeners = scene.directory.listeners
    remap_listeners[0]("")
    await scene.drive()
    await scene.write(1, "old")
    scene.clock.advance(10)
    scene.directory.rows[:] = [replace(ROW, uuid="late"), replace(ROW, uuid="all", start="TRIM_HORIZON")]
    remap_listeners[0]("")
    await scene.drive()
    assert scene.batches() == [["old"]]
    await scene.write(2, "new")
    await scene.drive()
    assert sorted(scene.batches()[1:]) == [["new"], ["new"]]


async def test_a_window_gathers_what_comes_meanwhile(scene: Scene) -> None:
    remap(scene, window_s=5.0, batch_size=3)
    await scene.drive()
    await scene.write(1, "a")
    await scene.drive(2)
    await scene.write(2, "b")
    await scene.drive(2)
    assert scene.batches() == []
    await scene.drive(1)
    assert scene.batches() == [["a", "b"]]
    await scene.write(3, "c", "d", "e")
    await scene.drive()
    assert scene.batches()[1:] == [["c", "d", "e"]]


async def test_a_batch_that_fails_is_tried_again_in_order_and_for_ever(scene: Scene) -> None:
    failures = [failed(), failed(), failed()]

    async def act(spec: FunctionSpec, call: Invocation) -> Outcome:
        return failures.pop() if failures else returned()

    scene.engine.act = act
    await scene.write(1, "a", "b")
    await scene.drive()
    assert len(scene.engine.calls) == 1
    await scene.write(3, "c")
    await scene.drive(0.9)
    assert len(scene.engine.calls) == 1
    assert scene.directory.results["m-1"].startswith("PROBLEM")
    assert (scene.mappings.iterator_age_s("f") or 0) > 0
    for _ in range(4):
        await scene.drive(60)
    assert scene.batches()[-1] == ["a", "b", "c"]
    assert scene.batches().count(["a", "b", "c"]) == 3
    assert scene.mappings.iterator_age_s("f") == 0.0
    assert scene.mappings.iterator_age_s("other") is None


async def test_partial_answers_go_on_at_the_first_that_failed(scene: Scene) -> None:
    remap(scene, report_failures=True)
    await scene.drive()

    async def act(spec: FunctionSpec, call: Invocation) -> Outcome:
        ids = ids_of(call.payload)
        bad = [name for name in ids if name.endswith("/3")] if len(scene.engine.calls) == 1 else []
        return returned({"batchItemFailures": [{"itemIdentifier": name} for name in bad]})

    scene.engine.act = act
    await scene.write(1, "a", "b", "c", "d")
    await scene.drive()
    await scene.drive(2)
    assert scene.batches() == [["a", "b", "c", "d"], ["c", "d"]]


async def test_an_answer_that_is_none_fails_the_whole_batch(scene: Scene) -> None:
    remap(scene, report_failures=True, most_retries=0)
    await scene.drive()
    answers = (b"[1]", b"{", b'{"batchItemFailures": 1}', b'{"batchItemFailures": [{}]}')
    for seq, answer in enumerate(answers, start=1):

        async def act(spec: FunctionSpec, call: Invocation, answer: bytes = answer) -> Outcome:
            return Outcome(payload=answer)

        scene.engine.act = act
        await scene.write(seq, "a")
        await scene.drive()
        await scene.drive(100)
        assert scene.batches() == [["a"]] * seq, answer
        assert scene.directory.results["m-1"].startswith("PROBLEM"), answer


async def test_a_batch_is_halved_until_the_bad_one_is_alone_and_reported(scene: Scene) -> None:
    queue = "arn:aws:sqs:eu-central-1:123456789012:bad"
    remap(scene, bisect=True, most_retries=1, on_failure=queue)
    await scene.drive()

    async def act(spec: FunctionSpec, call: Invocation) -> Outcome:
        return failed() if "bad" in texts_of(call.payload) else returned()

    scene.engine.act = act
    await scene.write(1, "a", "b", "bad", "d", "e")
    for _ in range(12):
        await scene.drive(60)
    took = [batch for batch in scene.batches() if "bad" not in batch]
    assert [text for batch in took for text in batch] == ["a", "b", "d", "e"]
    assert scene.batches().count(["bad"]) == 2
    (told,) = scene.told
    record = orjson.loads(told.payload)
    assert told.target == queue
    assert record["requestContext"]["condition"] == "RetryAttemptsExhausted"
    assert record["TopicBatchInfo"]["startSequenceNumber"] == f"r1/7/{EPOCH}/3"
    assert record["TopicBatchInfo"]["batchSize"] == 1


async def test_what_is_too_old_is_given_up(scene: Scene) -> None:
    remap(scene, most_age_s=60.0)
    await scene.drive()

    async def act(spec: FunctionSpec, call: Invocation) -> Outcome:
        return failed()

    scene.engine.act = act
    await scene.write(1, "a")  # its robot's clock is long ago, and so is the time when the gateway got it
    await scene.drive()
    await scene.drive(100)
    assert scene.batches() == [["a"]]


@on_both
async def test_filters_let_only_through_what_fits_and_pass_the_rest(scene: Scene) -> None:
    remap(scene, filters=({"data": {"detail": {"message": {"data": [{"prefix": "low"}]}}}},))
    await scene.drive()
    await scene.write(1, "high", "low 1", "high", "low 2")
    await scene.write(5, "high")
    await scene.drive()
    assert scene.batches() == [["low 1", "low 2"]]
    scene.again()
    await scene.drive(5)
    assert len(scene.engine.calls) == 1


@on_both
async def test_a_gateway_that_dies_takes_up_where_it_was(scene: Scene) -> None:
    await scene.write(1, "a")
    await scene.drive()
    scene.engine.act = throttled
    await scene.write(2, "b")
    await scene.drive()
    scene.engine.act = goes
    scene.again()
    await scene.drive(5)
    assert scene.batches()[0] == ["a"]
    assert scene.batches()[-1] == ["b"]
    await scene.drive(60)
    assert scene.batches().count(["a"]) == 1


async def throttled(spec: FunctionSpec, call: Invocation) -> Outcome:
    """No room."""
    raise ThrottledError("full")


async def test_a_disabled_mapping_stays_where_it_is(scene: Scene) -> None:
    await scene.write(1, "a")
    await scene.drive()
    remap(scene, enabled=False)
    await scene.drive()
    await scene.write(2, "b")
    await scene.drive(60)
    assert scene.batches() == [["a"]]
    remap(scene, enabled=True)
    await scene.drive(5)
    assert scene.batches() == [["a"], ["b"]]


async def test_one_robot_that_fails_does_not_hold_up_the_others(scene: Scene) -> None:
    async def act(spec: FunctionSpec, call: Invocation) -> Outcome:
        return failed() if "bad" in texts_of(call.payload) else returned()

    scene.engine.act = act
    await scene.write(1, "bad", robot="r1")
    await scene.drive()
    for number in range(2, 8):
        await scene.write(1, f"of r{number}", robot=f"r{number}")
    await scene.drive()
    good = sorted(batch[0] for batch in scene.batches() if batch != ["bad"])
    assert good == [f"of r{number}" for number in range(2, 8)]


@on_both
async def test_random_failures_and_deaths_lose_nothing_and_keep_the_order(scene: Scene) -> None:
    rng = random.Random(7)
    remap(scene, batch_size=4)
    await scene.drive()

    async def act(spec: FunctionSpec, call: Invocation) -> Outcome:
        return failed() if rng.random() < 0.3 else returned()

    scene.engine.act = act
    written: dict[str, list[str]] = {"r1": [], "r2": []}
    for _ in range(25):
        robot = rng.choice(("r1", "r2"))
        texts = [f"{robot} {len(written[robot]) + n}" for n in range(rng.randrange(1, 6))]
        await scene.write(len(written[robot]) + 1, *texts, robot=robot)
        written[robot] += texts
        await scene.drive(rng.choice((0.0, 1.0, 30.0)))
        if rng.random() < 0.3:
            scene.again()
    scene.engine.act = goes
    for _ in range(10):
        await scene.drive(60)
    for robot, texts in written.items():
        firsts = list(dict.fromkeys(text for batch in scene.batches() for text in batch if text.startswith(robot)))
        assert firsts == texts
