"""Traces reach a real collector; one that is gone costs traces and nothing else."""

from __future__ import annotations

import asyncio
import contextlib
import sys
from collections.abc import Sequence

import pytest

from gateway.domain.trace import RobotTimes
from gateway.ops.otlp import OtlpQueue, check_otlp, open_exporter
from gateway.ops.sample_trace import TracedSample
from metaros.errors import ConfigError
from metaros.limits import Limits
from tests.support.servers.otlp_collector import running_collector
from tests.support.waiting import wait_until_async

START_NS = 1_700_000_000 * 10**9


def traced(number: int) -> TracedSample:
    """A live sample's, with its fan-out."""
    times = RobotTimes(
        trace_id=f"{number:032x}",
        span_id="cd" * 8,
        seq=3,
        tapped_ns=START_NS + 1000,
        taken_ns=START_NS + 2000,
        accepted_ns=0,
        sent_ns=START_NS + 3000,
        clock_offset_ns=0,
    )
    return TracedSample(
        robot="r",
        topic="/t",
        delivery="live",
        size_bytes=5,
        samples=1,
        times=times,
        stamp_ns=START_NS,
        received_ns=START_NS + 4000,
        given_ns=START_NS + 5000,
        written_ns=START_NS + 6000,
    )


class Slow:
    """Counts what it is given, and takes it when it is told."""

    def __init__(self, *, takes: bool = True) -> None:
        self.given: list[int] = []
        self.takes = takes
        self.closed = False

    def send(self, traced_samples: Sequence[TracedSample]) -> bool:
        self.given.append(len(traced_samples))
        return self.takes

    def close(self) -> None:
        self.closed = True


async def test_a_collector_gets_every_stage_under_its_root() -> None:
    with running_collector() as collector:
        queue = OtlpQueue(open_exporter(collector.url, gateway_id="g1"))
        sending = asyncio.create_task(queue.run())
        queue.put(traced(7))
        await wait_until_async(lambda: queue.exported == 1)
        sending.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await sending
        queue.put(traced(8))
        await queue.close()
        assert (queue.exported, queue.lost) == (2, 0)
    spans = {span.name: span for span in collector.spans[f"{7:032x}"]}
    assert list(spans) == ["sample", "bus", "tap", "uplink", "link", "ingest", "fanout"]
    root = spans["sample"]
    assert root.span_id.hex() == "cd" * 8
    assert (root.start_time_unix_nano, root.end_time_unix_nano) == (START_NS, START_NS + 6000)
    assert {span.parent_span_id for name, span in spans.items() if name != "sample"} == {root.span_id}
    assert len({span.span_id for span in spans.values()}) == 7
    assert {item.key: item.value.string_value for item in root.attributes}["metaros.topic"] == "/t"
    assert f"{8:032x}" in collector.spans


async def test_a_collector_that_refuses_costs_traces_counted_and_said_once(caplog: pytest.LogCaptureFixture) -> None:
    slow = Slow(takes=False)
    queue = OtlpQueue(slow)
    for number in range(3):
        queue.put(traced(number))
        await queue.close()
    assert (queue.exported, queue.lost, slow.closed) == (0, 3, True)
    assert len([item for item in caplog.records if "--otlp" in item.getMessage()]) == 1


async def test_what_waits_is_bounded_and_goes_in_portions() -> None:
    slow = Slow()
    queue = OtlpQueue(slow, limits=Limits(traces_export=600))
    for number in range(700):
        queue.put(traced(number))
    await queue.close()
    assert slow.given == [256, 256, 88]
    assert (queue.exported, queue.lost) == (600, 100)


@pytest.mark.parametrize("url", ["collector:4318", "grpc://collector:4317", "http://", "file:///x"])
def test_what_is_no_collectors_address_is_refused(url: str) -> None:
    with pytest.raises(ConfigError, match="--otlp"):
        check_otlp(url)


def test_without_the_extra_the_setting_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    check_otlp("")
    check_otlp("http://collector:4318")
    monkeypatch.setitem(sys.modules, "opentelemetry.exporter.otlp.proto.http.trace_exporter", None)
    with pytest.raises(ConfigError, match="otel"):
        check_otlp("http://collector:4318")
