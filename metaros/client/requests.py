"""REST requests as values, with the parser of their answer. Pure: both clients send them."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar
from urllib.parse import quote

from metaros.cdr import codec
from metaros.client.results import Command, Robot, Series
from metaros.errors import PeerError
from metaros.idl import Message

__all__ = [
    "RestRequest",
    "answer_of",
    "call",
    "command",
    "get",
    "merge",
    "metrics",
    "programs_port",
    "publish",
    "robot_path",
    "robots",
    "series",
]

T = TypeVar("T")
Names = str | Sequence[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class RestRequest(Generic[T]):
    """One request; `idempotent`: it may be sent again when nobody knows what became of it."""

    method: str
    path: str
    read: Callable[[Any], T]
    query: Mapping[str, Any] = field(default_factory=dict)
    content: bytes | None = None
    kind: str = "application/json"
    headers: Mapping[str, str] = field(default_factory=dict)
    idempotent: bool = False
    timeout_s: float | None = None

    @property
    def sent_headers(self) -> dict[str, str]:
        """Its own, with the kind of its content."""
        return {**self.headers, **({} if self.content is None else {"content-type": self.kind})}

    @property
    def sent_query(self) -> dict[str, Any]:
        """Without what is None."""
        return {name: value for name, value in self.query.items() if value is not None}


def robot_path(robot: str, rest: str = "") -> str:
    """The path of a robot, or of something of it."""
    return f"/api/v1/robots/{quote(robot, safe='')}{rest}"


def get(path: str, read: Callable[[Any], T], **query: Any) -> RestRequest[T]:
    """A GET."""
    return RestRequest(method="GET", path=path, read=read, query=query, idempotent=True)


def robots(*, selector: str | None, after: Any) -> RestRequest[tuple[list[Robot], Any]]:
    """A page of robots, and where the next one begins; None: nowhere."""
    query = {"selector": selector, "after": after, "limit": 1000}

    def read(answer: Any) -> tuple[list[Robot], Any]:
        return [Robot.of(item) for item in answer["robots"]], answer.get("next")

    return get("/api/v1/robots", read, **query)


def publish(
    robot: str, topic: str, message: Any, *, type_name: str, lease_id: str, sent_ns: int, timeout_s: float | None
) -> RestRequest[None]:
    """A message class's instance goes as CDR, anything else as JSON."""
    asked = {"topic": topic, "lease_id": lease_id, "sent_ns": sent_ns}
    path, read = robot_path(robot, "/publish"), _nothing
    if isinstance(message, Message):
        name = type_name or _type_of(message)
        content = codec(name).encode(message)
        query = {**asked, "type": name, "sent_ns": str(sent_ns)}
        kind = "application/cdr"
        return RestRequest(
            method="POST", path=path, read=read, query=query, content=content, kind=kind, timeout_s=timeout_s
        )
    body = {**asked, "type": type_name, "message": message}
    return RestRequest(method="POST", path=path, read=read, content=json.dumps(body).encode(), timeout_s=timeout_s)


def call(
    robot: str, service: str, request: Mapping[str, Any], *, type_name: str, timeout_s: float, lease_id: str
) -> RestRequest[Any]:
    """A call of a service."""
    body = {"service": service, "type": type_name, "request": dict(request), "timeout_s": timeout_s}
    return RestRequest(
        method="POST",
        path=robot_path(robot, "/services/call"),
        read=lambda answer: answer["response"],
        content=json.dumps({**body, "lease_id": lease_id}).encode(),
        timeout_s=timeout_s + 30.0,
    )


def programs_port() -> RestRequest[int]:
    """The gateway's gRPC port for programs."""
    return get("/api/v1/gateway", lambda answer: int(answer["programs_port"]))


def command(
    robot: str, kind: str, request: Mapping[str, Any], *, key: str, wait_s: float, options: Mapping[str, Any]
) -> RestRequest[Command]:
    """A command; its key lets the gateway know it again, so that it may be sent again."""
    body = {"kind": kind, "request": dict(request), **options}
    return RestRequest(
        method="POST",
        path=robot_path(robot, "/commands"),
        read=Command.of,
        query={"wait_s": wait_s},
        content=json.dumps(body).encode(),
        headers={"idempotency-key": key},
        idempotent=True,
        timeout_s=wait_s + 30.0,
    )


def merge(path: str, document: Any, *, method: str = "PATCH") -> RestRequest[Any]:
    """A change by a document, and what the gateway says of it."""
    return RestRequest(method=method, path=path, read=_itself, content=json.dumps(document).encode())


def series(robot: str, names: Names, *, start: str, end: str, points: int) -> RestRequest[dict[str, Series]]:
    """Columns of series, by name."""
    wanted = [names] if isinstance(names, str) else list(names)
    query = {"name": wanted, "start": start, "end": end, "points": points}
    return get(robot_path(robot, "/metrics/range"), _series, **query)


def metrics(robot: str) -> RestRequest[list[Any]]:
    """The stored series, each with its newest value."""
    return get(robot_path(robot, "/metrics"), lambda answer: list(answer["series"]))


def answer_of(content: bytes) -> Any:
    """The JSON of an answer; PeerError for what no gateway says."""
    try:
        return json.loads(content) if content else None
    except ValueError as error:
        raise PeerError(f"what answers is no gateway: {content[:80]!r}") from error


def _series(answer: Any) -> dict[str, Series]:
    columns = ("stamp_ms", "mean", "min", "max", "count")
    return {
        item["name"]: Series(item["name"], *(tuple(item[column]) for column in columns)) for item in answer["series"]
    }


def _type_of(message: Message) -> str:
    return str(type(message).__metaros_name__)


def _nothing(_answer: Any) -> None:
    return None


def _itself(answer: Any) -> Any:
    return answer
