"""Results of functions on robots: as they are stored, they become invocations in the record of functions and
events that rules may match, in the transaction that stores them. On the store's writer thread.

What a robot says of itself is believed as far as it goes: it is that robot's, whatever the result claims.
"""

from __future__ import annotations

import hashlib
import logging
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final

import orjson

from gateway.domain.automation.gateway_event import GatewayEvent
from gateway.domain.automation.invocation import ERROR, OK, ROBOT, TIMEOUT, Recorded
from gateway.domain.decoder import Decoder
from gateway.domain.fleet.command import new_command_id
from gateway.domain.sample import Sample
from gateway.errors import StoreError
from gateway.store.automation.gateway_events import add_gateway_events
from gateway.store.automation.invocations import add_invocations
from gateway.store.commit import CommitHook
from gateway.store.engine import StoreEngine
from gateway.store.writes import StreamWrite
from metaros.errors import MetarosError
from metaros.limits import LIMITS, Limits

__all__ = ["FUNCTION_RESULT", "RobotResults"]

log = logging.getLogger(__name__)
FUNCTION_RESULT: Final = "metaros.function.result"
SOURCE: Final = "metaros.function"
TOPIC: Final = "/functions/results"
STRING: Final = "std_msgs/msg/String"
_LETTERS: Final = "0123456789ABCDEFGHJKMNPQRSTVWXYZ"
_NAMES: Final = {key: re.compile(r"[\w-]{1,64}", re.ASCII) for key in ("id", "function", "status")}
OnGatewayEvents = Callable[[StoreEngine, Sequence[GatewayEvent], int], None]


class RobotResults:
    """A CommitHook around the one that judges samples: `inner` first, then the results among them."""

    def __init__(self, inner: CommitHook, judge: OnGatewayEvents, gateway: str, *, limits: Limits = LIMITS) -> None:
        """`judge` is told of results that are new."""
        self._inner, self._judge, self._gateway, self._limits = inner, judge, gateway, limits
        self._decoder = Decoder()

    def on_writes(self, engine: StoreEngine, fresh: Sequence[StreamWrite], now_ns: int) -> None:
        """Samples that are being stored. Raises StoreError."""
        self._inner.on_writes(engine, fresh, now_ns)
        found = [pair for write in fresh if _is_ours(write) for pair in self._read(write, now_ns)]
        if not found:
            return
        add_invocations(engine, [call for call, _ in found])
        try:
            gateway_events = [gateway_event for _, gateway_event in found]
            new = add_gateway_events(engine, gateway_events, gateway=self._gateway, now_ns=now_ns, limits=self._limits)
        except StoreError:
            raise
        except MetarosError as error:  # one is too large: the calls are recorded all the same
            log.warning("results of functions on robots are no events: %s", error)
            return
        self._judge(engine, new, now_ns)

    def on_aborted(self) -> None:
        """None of it happened."""
        self._inner.on_aborted()

    def _read(self, write: StreamWrite, now_ns: int) -> Iterator[tuple[Recorded, GatewayEvent]]:
        assert write.run is not None
        for sample in write.run.samples():
            document = self._document(sample)
            if document is not None:
                yield _recorded(write.robot, document, now_ns), _gateway_event(write.robot, document, sample.stamp_ns)

    def _document(self, sample: Sample) -> dict[str, Any] | None:
        """What a message says; None where it is sealed, too large, or no result."""
        if len(sample.payload) > self._limits.rule_message_bytes:
            return None
        try:
            found = orjson.loads(self._decoder.decode(sample.channel, bytes(sample.payload))["data"])
        except (MetarosError, ValueError) as error:
            log.debug("a message on %s is no result: %s", sample.channel.topic, error)
            return None
        if not isinstance(found, dict) or not all(isinstance(found.get(key), str) for key in _NAMES):
            return None
        return found if all(grammar.fullmatch(found[key]) for key, grammar in _NAMES.items()) else None


def _is_ours(write: StreamWrite) -> bool:
    run = write.run
    return run is not None and run.channel.topic.endswith(TOPIC) and run.channel.schema_name == STRING


def _attempt(document: dict[str, Any]) -> str:
    """An attempt's name, the same each time that it is told."""
    return f"{document['id']}/{_number(document, 'attempt'):.0f}.{_number(document, 'losses'):.0f}"


def _gateway_event(robot: str, document: dict[str, Any], stamp_ns: int) -> GatewayEvent:
    data = {**document, "robot": robot}
    return GatewayEvent(
        id=f"{robot}/{_attempt(document)}",
        type=FUNCTION_RESULT,
        source=SOURCE,
        at_ns=stamp_ns,
        robot=robot,
        data=data,
    )


def _recorded(robot: str, document: dict[str, Any], now_ns: int) -> Recorded:
    began_ns = min(now_ns, max(0, int(_number(document, "began_ns"))))
    error_type = _text(document, "error_type", 200)
    failed = TIMEOUT if error_type == "Sandbox.Timeout" else ERROR
    return Recorded(
        id=new_command_id(began_ns)[:10] + _tail(f"{robot}/{_attempt(document)}"),
        request_id=document["id"],
        function=document["function"],
        version=_text(document, "version", 64),
        qualifier="",
        kind=ROBOT,
        robot=robot,
        status=OK if document["status"] == "ok" else failed,
        error_type=error_type,
        error_message=_text(document, "error_message", 1000),
        began_ns=began_ns,
        duration_ms=_number(document, "duration_ms"),
        init_ms=_number(document, "init_ms"),
        max_memory_mb=int(_number(document, "max_memory_mb")),
        log="",
    )


def _tail(name: str) -> str:
    """16 letters that are an attempt's own: of one that is told twice the record is kept once."""
    number = int.from_bytes(hashlib.sha256(name.encode()).digest()[:10], "big")
    return "".join(_LETTERS[number >> shift & 31] for shift in range(75, -5, -5))


def _text(document: dict[str, Any], key: str, most_chars: int) -> str:
    value = document.get(key, "")
    return value[:most_chars].replace("\0", "") if isinstance(value, str) else ""


def _number(document: dict[str, Any], key: str) -> float:
    """A number of a record; 0 for what is none, or none that a record holds."""
    value = document.get(key, 0)
    good = isinstance(value, int | float) and not isinstance(value, bool) and 0 <= value < 2**63
    return value if good else 0
