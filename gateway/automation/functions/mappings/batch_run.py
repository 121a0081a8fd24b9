"""Runs a batch of an event source mapping: calls the function, reads its answer, stores the cursor."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import orjson

from gateway.automation.functions.destinations import OWN, destination_put
from gateway.automation.functions.directory import MappingRow
from gateway.automation.functions.errors import UnknownFunctionError
from gateway.automation.functions.invoker import Invoked, Invoker
from gateway.automation.functions.mappings.batch import MOST_WAIT_S, Batch, Verdict, failed_from, judge
from gateway.domain.automation.delivery import Put
from gateway.domain.automation.shapes import kinesis, moment
from gateway.store.automation.mapping_cursors import Cursor, Stream, put_cursor
from gateway.store.engine import StoreEngine
from metaros.automation.functions.errors import EngineClosedError, ThrottledError
from metaros.clock import Clock
from metaros.errors import MetarosError

__all__ = ["BatchResult", "BatchRun", "BatchRunner", "Database"]

Result = TypeVar("Result")
THROTTLE_WAIT_S = 1.0
OK, FAILED = "OK", "PROBLEM: Function call failed"


class Database(Protocol):
    """What is needed of the store."""

    async def run(self, job: Callable[[StoreEngine], Result]) -> Result:
        """A job in one write transaction."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchRun:
    """A batch that is due, and where its stream is."""

    row: MappingRow
    stream: Stream
    cursor: Cursor
    batch: Batch


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchResult:
    """Where the stream is now, and when to go on; `puts` were stored with that."""

    cursor: Cursor
    wait_s: float = 0.0
    puts: Sequence[Put] = ()
    result: str = OK


class BatchRunner:
    """Hands batches over."""

    def __init__(
        self,
        database: Database,
        invoker: Invoker,
        *,
        put: Callable[[StoreEngine, Sequence[Put]], object],
        clock: Clock,
    ) -> None:
        """`put` stores puts inside a transaction."""
        self._database = database
        self._invoker = invoker
        self._put = put
        self._clock = clock

    async def take(self, batch_run: BatchRun) -> BatchResult:
        """Call the function with a batch, and keep how far that came. Raises StoreError: then the batch comes again."""
        if not batch_run.batch.items:  # nothing of it is wanted
            return await self._keep(batch_run, Verdict(cursor=Cursor(batch_run.batch.last_seq, 0, 0)), None, OK)
        row = batch_run.row
        event = orjson.dumps(kinesis([item.gateway_event for item in batch_run.batch.items], row.source_arn))
        request_id = self._invoker.new_request_id()
        try:
            invoked = await self._invoker.invoke(
                row.function,
                row.qualifier,
                event,
                kind="mapping",
                robot=batch_run.stream.robot,
                request_id=request_id,
            )
        except (ThrottledError, EngineClosedError) as error:
            return BatchResult(cursor=batch_run.cursor, wait_s=THROTTLE_WAIT_S, result=f"PROBLEM: {error.code}")
        except UnknownFunctionError as error:
            return BatchResult(cursor=batch_run.cursor, wait_s=MOST_WAIT_S, result=f"PROBLEM: {error}")
        except MetarosError as error:
            return BatchResult(cursor=batch_run.cursor, wait_s=THROTTLE_WAIT_S, result=f"PROBLEM: {error}")
        outcome = invoked.outcome
        failed = failed_from(batch_run.batch.items, row, ok=outcome.ok, payload=outcome.payload)
        verdict = judge(batch_run.batch, row, batch_run.cursor, failed=failed, now_ns=self._clock.wall_ns())
        return await self._keep(batch_run, verdict, invoked, OK if failed is None else FAILED)

    async def _keep(self, batch_run: BatchRun, verdict: Verdict, invoked: Invoked | None, result: str) -> BatchResult:
        puts = self._puts(batch_run, verdict, invoked)
        now_ns = self._clock.wall_ns()

        def job(engine: StoreEngine) -> None:
            put_cursor(engine, batch_run.row.uuid, batch_run.stream, verdict.cursor, now_ns=now_ns)
            if puts:
                self._put(engine, puts)

        await self._database.run(job)
        return BatchResult(cursor=verdict.cursor, wait_s=verdict.wait_s, puts=puts, result=result)

    def _puts(self, batch_run: BatchRun, verdict: Verdict, invoked: Invoked | None) -> Sequence[Put]:
        """What OnFailure is told of messages that are given up."""
        row = batch_run.row
        if not verdict.dropped or not row.on_failure or invoked is None:
            return ()
        first, last = verdict.dropped[0], verdict.dropped[-1]
        record: dict[str, Any] = {
            "requestContext": {
                "requestId": invoked.request_id,
                "functionArn": f"{OWN}{row.function}:{row.qualifier or '$LATEST'}",
                "condition": verdict.why,
                "approximateInvokeCount": batch_run.cursor.tries + 1,
            },
            "responseContext": {"statusCode": 200, "executedVersion": invoked.version, "functionError": "Unhandled"},
            "version": "1.0",
            "timestamp": moment(self._clock.wall_ns()),
            "TopicBatchInfo": {
                "robot": batch_run.stream.robot,
                "topic": first.gateway_event.data["topic"],
                "startSequenceNumber": first.gateway_event.id,
                "endSequenceNumber": last.gateway_event.id,
                "approximateArrivalOfFirstRecord": moment(first.receive_ns),
                "approximateArrivalOfLastRecord": moment(last.receive_ns),
                "batchSize": len(verdict.dropped),
                "streamArn": row.source_arn,
            },
        }
        facts = {"function": record["requestContext"]["functionArn"], "side": "Failure"}
        dedup = f"{row.uuid}/{first.gateway_event.id}/{last.seq}"
        robot, new_id = batch_run.stream.robot, self._invoker.new_request_id
        return [destination_put(row.on_failure, record, facts, dedup=dedup, robot=robot, new_id=new_id)]
