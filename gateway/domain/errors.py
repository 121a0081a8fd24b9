"""The errors of twins, templates, selectors and commands; `gateway.errors` has the tree they belong to.

RequestError
├── SelectorError           a selector or a label breaks the grammar            selector_invalid
├── UnknownTemplateError    there is no such template                           unknown_template
├── UnknownNodeError        the robot has no such node                          unknown_node
├── UnknownRevisionError    the revision of a twin is not kept, or never was    unknown_revision
├── TwinChangedError        somebody else was faster than this edit             twin_changed
├── ChangedError            what If-Match names is not what there is          changed
├── UnknownCommandError     there is no such command                            unknown_command
├── QueueFullError          the queue takes no more deliveries now              queue_full
├── IdempotencyConflictError  the key was used for another request              idempotency_conflict
└── CommandDeliveredError   too late to take the command back                   command_delivered
"""

from __future__ import annotations

from gateway.errors import RequestError

__all__ = [
    "ChangedError",
    "CommandDeliveredError",
    "IdempotencyConflictError",
    "QueueFullError",
    "SelectorError",
    "TwinChangedError",
    "UnknownCommandError",
    "UnknownDeadLetterError",
    "UnknownNodeError",
    "UnknownReplayError",
    "UnknownRevisionError",
    "UnknownTemplateError",
]


class UnknownTemplateError(RequestError):
    """There is no such template."""

    code = "unknown_template"


class UnknownNodeError(RequestError):
    """Neither the robot's desired state nor the robot itself names such a node; the message says which there are."""

    code = "unknown_node"


class UnknownRevisionError(RequestError):
    """The revision of a twin is not kept any more, or never was."""

    code = "unknown_revision"


class SelectorError(RequestError):
    """A selector or a label breaks the grammar; the message says where."""

    code = "selector_invalid"


class TwinChangedError(RequestError):
    """The twin or template is not at the revision that If-Match names: somebody else was faster."""

    code = "twin_changed"


class ChangedError(RequestError):
    """What If-Match names is not what there is by now: somebody else was faster."""

    code = "changed"


class UnknownCommandError(RequestError):
    """There is no such command, as far as who asks may know."""

    code = "unknown_command"

    @classmethod
    def of(cls, command_id: str) -> UnknownCommandError:
        """In the same words whether there is none or its robot is out of scope."""
        return cls(f"there is no command {command_id[:40]!r}")


class IdempotencyConflictError(RequestError):
    """An idempotency key that was used for another request."""

    code = "idempotency_conflict"


class CommandDeliveredError(RequestError):
    """A command that has left for its robot, or is over, cannot be taken back."""

    code = "command_delivered"


class UnknownDeadLetterError(RequestError):
    """There is no such dead letter, as far as who asks may know."""

    code = "unknown_dead_letter"


class UnknownReplayError(RequestError):
    """There is no such replay."""

    code = "unknown_replay"


class QueueFullError(RequestError):
    """The queue takes no more deliveries now; nothing of what was to be put was. The message names the limit."""

    code = "queue_full"
