"""What a Foxglove client asks in JSON: each `op` as a frozen value, checked field by field. Pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import orjson

from gateway.errors import InvalidRequestError
from metaros.limits import LIMITS

__all__ = [
    "Advertise",
    "ClientChannel",
    "FetchAsset",
    "GetParameters",
    "Parameter",
    "SetParameters",
    "Subscribe",
    "TextRequest",
    "Unadvertise",
    "Unsubscribe",
    "WatchGraph",
    "WatchParameters",
    "read_text",
]

MOST_ITEMS = 10_000  # of one list; a message is bounded besides
U32 = 2**32 - 1


@dataclass(frozen=True, slots=True)
class Subscribe:
    """Samples of channels: (the client's subscription id, the server's channel id)."""

    pairs: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class Unsubscribe:
    """No more of these subscriptions."""

    ids: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class ClientChannel:
    """A channel that a client will publish on."""

    id: int
    topic: str
    encoding: str
    schema_name: str


@dataclass(frozen=True, slots=True)
class Advertise:
    """The client will publish on these."""

    channels: tuple[ClientChannel, ...]


@dataclass(frozen=True, slots=True)
class Unadvertise:
    """The client publishes on these no more."""

    ids: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter's name, value (None: none) and Foxglove type ("" where its JSON type says all)."""

    name: str
    value: Any = None
    type: str = ""


@dataclass(frozen=True, slots=True)
class GetParameters:
    """The values of parameters; no names: of all."""

    names: tuple[str, ...]
    id: str | None


@dataclass(frozen=True, slots=True)
class SetParameters:
    """New values; with an id their state is told back."""

    parameters: tuple[Parameter, ...]
    id: str | None


@dataclass(frozen=True, slots=True)
class WatchParameters:
    """Send updates (or no more) when these change; no names: all of them."""

    names: tuple[str, ...]
    on: bool


@dataclass(frozen=True, slots=True)
class WatchGraph:
    """Send updates (or no more) of who publishes, subscribes and serves what."""

    on: bool


@dataclass(frozen=True, slots=True)
class FetchAsset:
    """A file by its URI."""

    uri: str
    request_id: int


TextRequest = (
    Subscribe
    | Unsubscribe
    | Advertise
    | Unadvertise
    | GetParameters
    | SetParameters
    | WatchParameters
    | WatchGraph
    | FetchAsset
)


def read_text(text: str) -> TextRequest:
    """What a client's text message asks; InvalidRequestError names what is wrong with it."""
    if len(text) > LIMITS.json_bytes:
        raise InvalidRequestError(f"a request has at most {LIMITS.json_bytes} bytes")
    try:
        said = orjson.loads(text)
    except orjson.JSONDecodeError as error:
        raise InvalidRequestError(f"no JSON: {error}") from None
    if not isinstance(said, dict):
        raise InvalidRequestError("a request is a JSON object")
    op = said.get("op")
    read = _OPS.get(op) if isinstance(op, str) else None
    if read is None:
        raise InvalidRequestError(f"op {str(op)[:40]!r} is unknown: it is one of {', '.join(_OPS)}")
    return read(said)


def _subscribe(said: Mapping[str, Any]) -> TextRequest:
    items = _objects(said, "subscriptions")
    return Subscribe(tuple((_number(item, "id"), _number(item, "channelId", most=2**53)) for item in items))


def _advertise(said: Mapping[str, Any]) -> TextRequest:
    channels = tuple(
        ClientChannel(
            _number(item, "id"), _text(item, "topic"), _text(item, "encoding"), _text(item, "schemaName", least=0)
        )
        for item in _objects(said, "channels")
    )
    return Advertise(channels)


def _get(said: Mapping[str, Any]) -> TextRequest:
    return GetParameters(_texts(said, "parameterNames"), _id(said))


def _set(said: Mapping[str, Any]) -> TextRequest:
    parameters = tuple(
        Parameter(_text(item, "name"), item.get("value"), _text(item, "type", least=0) if "type" in item else "")
        for item in _objects(said, "parameters")
    )
    return SetParameters(parameters, _id(said))


_OPS: dict[str, Callable[[Mapping[str, Any]], TextRequest]] = {
    "subscribe": _subscribe,
    "unsubscribe": lambda said: Unsubscribe(_numbers(said, "subscriptionIds")),
    "advertise": _advertise,
    "unadvertise": lambda said: Unadvertise(_numbers(said, "channelIds")),
    "getParameters": _get,
    "setParameters": _set,
    "subscribeParameterUpdates": lambda said: WatchParameters(_texts(said, "parameterNames"), on=True),
    "unsubscribeParameterUpdates": lambda said: WatchParameters(_texts(said, "parameterNames"), on=False),
    "subscribeConnectionGraph": lambda said: WatchGraph(on=True),
    "unsubscribeConnectionGraph": lambda said: WatchGraph(on=False),
    "fetchAsset": lambda said: FetchAsset(_text(said, "uri"), _number(said, "requestId")),
}


def _list(said: Mapping[str, Any], name: str) -> list[Any]:
    items = said.get(name)
    if not isinstance(items, list) or len(items) > MOST_ITEMS:
        raise InvalidRequestError(f"{name} is a list of at most {MOST_ITEMS}")
    return items


def _objects(said: Mapping[str, Any], name: str) -> list[dict[str, Any]]:
    items = _list(said, name)
    if not all(isinstance(item, dict) for item in items):
        raise InvalidRequestError(f"{name} is a list of objects")
    return items


def _texts(said: Mapping[str, Any], name: str) -> tuple[str, ...]:
    items = _list(said, name)
    if not all(isinstance(item, str) for item in items):
        raise InvalidRequestError(f"{name} is a list of texts")
    return tuple(items)


def _numbers(said: Mapping[str, Any], name: str) -> tuple[int, ...]:
    return tuple(_number({name: item}, name) for item in _list(said, name))


def _number(said: Mapping[str, Any], name: str, *, most: int = U32) -> int:
    value = said.get(name)
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= most:
        raise InvalidRequestError(f"{name} is a number from 0 to {most}")
    return value


def _text(said: Mapping[str, Any], name: str, *, least: int = 1) -> str:
    value = said.get(name)
    if not isinstance(value, str) or not least <= len(value) <= LIMITS.ros_name_chars * 4:
        raise InvalidRequestError(f"{name} is a text of {least} to {LIMITS.ros_name_chars * 4} characters")
    return value


def _id(said: Mapping[str, Any]) -> str | None:
    value = said.get("id")
    if value is not None and (not isinstance(value, str) or len(value) > LIMITS.ros_name_chars):
        raise InvalidRequestError(f"id is a text of at most {LIMITS.ros_name_chars} characters")
    return value
