"""One batch of an event source mapping: called, judged, and how far it came kept."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import orjson

from gateway.domain.delivery import Put
from gateway.domain.shapes import kinesis, moment
from gateway.functions.destinations import OWN, destination_put
from gateway.functions.directory import MappingRow
from gateway.functions.errors import UnknownFunctionError
from gateway.functions.invoker import Invoked, Invoker
from gateway.functions.mapping_batch import MOST_WAIT_S, Batch, Verdict, failed_from, judge
from gateway.store.engine import StoreEngine
from gateway.store.mapping_cursors import Cursor, Stream, put_cursor
from metaros.clock import Clock
from metaros.errors import MetarosError
from metaros.functions.faults import EngineClosedError, ThrottledError

__all__ = ["Database", "Turn", "TurnResult", "Turns"]

Result = TypeVar("Result")
THROTTLE_WAIT_S = 1.0
OK, FAILED = "OK", "PROBLEM: Function call failed"


class Database(Protocol):
    """What is needed of the store."""

    async def run(self, job: Callable[[StoreEngine], Result]) -> Result:
        """A job in one write transaction."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Turn:
    """A batch that is due, and where its stream is."""

    row: MappingRow
    stream: Stream
    cursor: Cursor
    batch: Batch


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnResult:
    """Where the stream is now, and when to go on; `puts` were stored with that."""

    cursor: Cursor
    wait_s: float = 0.0
    puts: Sequence[Put] = ()
    result: str = OK


class Turns:
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

    async def take(self, turn: Turn) -> TurnResult:
        """Call the function with a batch, and keep how far that came. Raises StoreError: then the batch comes again."""
        if not turn.batch.items:  # nothing of it is wanted
            return await self._keep(turn, Verdict(cursor=Cursor(turn.batch.last_seq, 0, 0)), None, OK)
        row = turn.row
        event = orjson.dumps(kinesis([item.happening for item in turn.batch.items], row.source_arn))
        request_id = self._invoker.new_request_id()
        try:
            invoked = await self._invoker.invoke(
                row.function,
                row.qualifier,
                event,
                kind="mapping",
                robot=turn.stream.robot,
                request_id=request_id,
            )
        except (ThrottledError, EngineClosedError) as error:
            return TurnResult(cursor=turn.cursor, wait_s=THROTTLE_WAIT_S, result=f"PROBLEM: {error.code}")
        except UnknownFunctionError as error:
            return TurnResult(cursor=turn.cursor, wait_s=MOST_WAIT_S, result=f"PROBLEM: {error}")
        except MetarosError as error:
            return TurnResult(cursor=turn.cursor, wait_s=THROTTLE_WAIT_S, result=f"PROBLEM: {error}")
        outcome = invoked.outcome
        failed = failed_from(turn.batch.items, row, ok=outcome.ok, payload=outcome.payload)
        verdict = judge(turn.batch, row, turn.cursor, failed=failed, now_ns=self._clock.wall_ns())
        return await self._keep(turn, verdict, invoked, OK if failed is None else FAILED)

    async def _keep(self, turn: Turn, verdict: Verdict, invoked: Invoked | None, result: str) -> TurnResult:
        puts = self._puts(turn, verdict, invoked)
        now_ns = self._clock.wall_ns()

        def job(engine: StoreEngine) -> None:
            put_cursor(engine, turn.row.uuid, turn.stream, verdict.cursor, now_ns=now_ns)
            if puts:
                self._put(engine, puts)

        await self._database.run(job)
        return TurnResult(cursor=verdict.cursor, wait_s=verdict.wait_s, puts=puts, result=result)

    def _puts(self, turn: Turn, verdict: Verdict, invoked: Invoked | None) -> Sequence[Put]:
        """What OnFailure is told of messages that are given up."""
        row = turn.row
        if not verdict.dropped or not row.on_failure or invoked is None:
            return ()
        first, last = verdict.dropped[0], verdict.dropped[-1]
        record: dict[str, Any] = {
            "requestContext": {
                "requestId": invoked.request_id,
                "functionArn": f"{OWN}{row.function}:{row.qualifier or '$LATEST'}",
                "condition": verdict.why,
                "approximateInvokeCount": turn.cursor.tries + 1,
            },
            "responseContext": {"statusCode": 200, "executedVersion": invoked.version, "functionError": "Unhandled"},
            "version": "1.0",
            "timestamp": moment(self._clock.wall_ns()),
            "TopicBatchInfo": {
                "robot": turn.stream.robot,
                "topic": first.happening.data["topic"],
                "startSequenceNumber": first.happening.id,
                "endSequenceNumber": last.happening.id,
                "approximateArrivalOfFirstRecord": moment(first.receive_ns),
                "approximateArrivalOfLastRecord": moment(last.receive_ns),
                "batchSize": len(verdict.dropped),
                "streamArn": row.source_arn,
            },
        }
        facts = {"function": record["requestContext"]["functionArn"], "side": "Failure"}
        dedup = f"{row.uuid}/{first.happening.id}/{last.seq}"
        robot, new_id = turn.stream.robot, self._invoker.new_request_id
        return [destination_put(row.on_failure, record, facts, dedup=dedup, robot=robot, new_id=new_id)]
