"""The interfaces that a service or an action brings along: halves, events and an action's inner services."""

from __future__ import annotations

from collections.abc import Iterator

from metaros.idl.definitions import ActionDefinition, Definition, Field, FieldType, MessageDefinition, ServiceDefinition

__all__ = ["derived_definitions", "root_names", "whole_message"]

_SUFFIXES = {
    "srv": ("_Request", "_Response", "_Event"),
    "action": (
        "_SendGoal_Request",
        "_SendGoal_Response",
        "_SendGoal_Event",
        "_GetResult_Request",
        "_GetResult_Response",
        "_GetResult_Event",
        "_SendGoal",
        "_GetResult",
        "_FeedbackMessage",
        "_Goal",
        "_Result",
        "_Feedback",
    ),
}

_TIME = FieldType("builtin_interfaces/msg/Time")
_GOAL_ID = Field("goal_id", FieldType("unique_identifier_msgs/msg/UUID"))


def root_names(name: str) -> Iterator[str]:
    """The services or actions that would derive an interface called `name`, longest first."""
    parts = name.split("/")
    if len(parts) == 3:
        for suffix in _SUFFIXES.get(parts[1], ()):
            if name.endswith(suffix) and len(parts[2]) > len(suffix):
                yield name[: -len(suffix)]


def derived_definitions(root: Definition) -> dict[str, Definition]:
    """Every interface that `root` derives, by full name."""
    if isinstance(root, ServiceDefinition):
        parts: tuple[Definition, ...] = (root.request, root.response, _event(root))
    elif isinstance(root, ActionDefinition):
        parts = (root.goal, root.result, root.feedback, *_action_parts(root))
    else:
        parts = ()
    return {part.name: part for part in parts}


def whole_message(root: ServiceDefinition | ActionDefinition) -> MessageDefinition:
    """The composite that the type hash of a service or an action is taken of."""
    if isinstance(root, ServiceDefinition):
        names = {"request_message": "Request", "response_message": "Response", "event_message": "Event"}
    else:
        names = {
            "goal": "Goal",
            "result": "Result",
            "feedback": "Feedback",
            "send_goal_service": "SendGoal",
            "get_result_service": "GetResult",
            "feedback_message": "FeedbackMessage",
        }
    fields = tuple(Field(field, FieldType(f"{root.name}_{part}")) for field, part in names.items())
    return MessageDefinition(root.name, fields)


def _event(service: ServiceDefinition) -> MessageDefinition:
    return MessageDefinition(
        f"{service.name}_Event",
        (
            Field("info", FieldType("service_msgs/msg/ServiceEventInfo")),
            Field("request", FieldType(service.request.name, "bounded", 1)),
            Field("response", FieldType(service.response.name, "bounded", 1)),
        ),
    )


def _action_parts(action: ActionDefinition) -> Iterator[Definition]:
    name = action.name
    send = ServiceDefinition(
        f"{name}_SendGoal",
        MessageDefinition(f"{name}_SendGoal_Request", (_GOAL_ID, Field("goal", FieldType(action.goal.name)))),
        MessageDefinition(f"{name}_SendGoal_Response", (Field("accepted", FieldType("bool")), Field("stamp", _TIME))),
    )
    result = ServiceDefinition(
        f"{name}_GetResult",
        MessageDefinition(f"{name}_GetResult_Request", (_GOAL_ID,)),
        MessageDefinition(
            f"{name}_GetResult_Response",
            (Field("status", FieldType("int8")), Field("result", FieldType(action.result.name))),
        ),
    )
    for service in (send, result):
        yield service
        yield from derived_definitions(service).values()
    yield MessageDefinition(f"{name}_FeedbackMessage", (_GOAL_ID, Field("feedback", FieldType(action.feedback.name))))
