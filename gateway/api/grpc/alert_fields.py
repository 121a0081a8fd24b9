"""What AlertService is asked, checked by the very models that REST checks its bodies with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar, get_args

from google.protobuf.message import Message
from pydantic import BaseModel, ValidationError

from gateway.alerting.alerts.errors import UnknownAlertError
from gateway.api.grpc.authenticate import Call
from gateway.api.grpc.fields import FieldFaultError
from gateway.domain.alert import ALERT_STATES, Alert, AlertFilter
from gateway.domain.finding import FindingSeverity
from gateway.domain.principal import Principal
from gateway.errors import ForbiddenError
from metaros._proto import alerts_pb2

__all__ = ["filter_of", "given", "read_as", "require_all_robots", "seen_alert", "seer"]

MAX_NAMED, NAME_CHARS, TEXT_CHARS, MAX_STAMP = 64, 128, 200, 2**62
Model = TypeVar("Model", bound=BaseModel)


def read_as(model: type[Model], **values: Any) -> Model:
    """The values as REST would take them; FieldFaultError names the first that does not fit."""
    try:
        return model.model_validate(values)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        name = ".".join(map(str, first["loc"])) or "request"
        raise FieldFaultError(name, f"{name}: {first['msg']}") from error


def given(request: Message, names: Sequence[str]) -> dict[str, Any]:
    """Those optional fields that the request has."""
    return {name: getattr(request, name) for name in names if request.HasField(name)}


def seer(principal: Principal) -> Callable[[str], bool] | None:
    """Which robots' alerts somebody may know of; None: all, the fleet's own too."""
    return None if principal.sees_all else lambda robot: bool(robot) and principal.sees(robot)


async def seen_alert(call: Call, alert_id: str) -> Alert:
    """One alert; UnknownAlertError also where its robot is out of scope."""
    found = await call.services.alerts.get(alert_id)
    sees = seer(call.principal)
    if sees is not None and not sees(found.robot):
        raise UnknownAlertError.of(alert_id)
    if found.robot:
        call.require(found.robot)
    return found


def require_all_robots(call: Call, what: str) -> None:
    """ForbiddenError for what reaches every robot, asked by somebody who is not to reach them all."""
    if not call.principal.sees_all:
        raise ForbiddenError(f"{what} are for every robot: they need somebody whose scope is all of them")


def filter_of(asked: alerts_pb2.AlertFilter, call: Call) -> AlertFilter:
    """Which alerts are asked for, of the robots in scope; FieldFaultError names what does not fit."""
    states = _words(asked.states, ALERT_STATES, "filter.states")
    severities = _words(asked.severities, get_args(FindingSeverity), "filter.severities")
    for name, named in (("filter.robots", asked.robots), ("filter.causes", asked.causes)):
        if len(named) > MAX_NAMED or any(len(text) > NAME_CHARS or "\0" in text for text in named):
            raise FieldFaultError(name, f"{name} has at most {MAX_NAMED} texts of {NAME_CHARS} characters, without NUL")
    if len(asked.text) > TEXT_CHARS or "\0" in asked.text:
        raise FieldFaultError("filter.text", f"filter.text has at most {TEXT_CHARS} characters, without NUL")
    for name, stamp in (("filter.from_ns", asked.from_ns), ("filter.until_ns", asked.until_ns)):
        if not 0 <= stamp < MAX_STAMP:
            raise FieldFaultError(name, f"{name} is in nanoseconds since 1970; 0 is no bound")
    return AlertFilter(
        states=states,
        severities=severities,
        robots=tuple(asked.robots),
        causes=tuple(asked.causes),
        text=asked.text,
        from_ns=asked.from_ns,
        until_ns=asked.until_ns,
        quiet=asked.quiet if asked.HasField("quiet") else None,
        sees=seer(call.principal),
    )


def _words(asked: Sequence[str], known: Sequence[str], name: str) -> tuple[Any, ...]:
    if strange := [word for word in asked if word not in known]:
        raise FieldFaultError(name, f"{name} is of {', '.join(known)}, not {strange[0][:40]!r}")
    return tuple(dict.fromkeys(asked))
