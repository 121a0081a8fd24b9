"""The errors of rules and hooks; their codes are rows of the gateway's table.

RequestError
├── RuleInvalidError       the rule's document cannot be               rule_invalid
├── UnknownRuleError       there is no such rule                       unknown_rule
├── UnknownTargetError     the rule has no such target                 unknown_target
├── UnknownHookError       there is no such hook                       unknown_hook
├── HookExistsError        there is a hook of that name                hook_exists
└── HookRefusedError       it does not prove who sent it               hook_refused
"""

from __future__ import annotations

from gateway.errors import RequestError

__all__ = [
    "HookExistsError",
    "HookRefusedError",
    "RuleInvalidError",
    "UnknownHookError",
    "UnknownRuleError",
    "UnknownTargetError",
]


class RuleInvalidError(RequestError):
    """The rule's document cannot be; `path` says where, like "targets[0].url"."""

    code = "rule_invalid"

    def __init__(self, path: str, message: str) -> None:
        super().__init__(f"{path}: {message}" if path else message)
        self.path = path
        self.fault = message


class UnknownRuleError(RequestError):
    """There is no such rule, as far as who asks may know."""

    code = "unknown_rule"

    @classmethod
    def of(cls, name: str) -> UnknownRuleError:
        """In the same words whether there is none or its robots are out of scope."""
        return cls(f"there is no rule {name[:64]!r}")


class UnknownTargetError(RequestError):
    """The rule has no target of that id, or that kind has no secret."""

    code = "unknown_target"


class UnknownHookError(RequestError):
    """There is no such hook, as far as who asks may know."""

    code = "unknown_hook"

    @classmethod
    def of(cls, name: str) -> UnknownHookError:
        """In the same words whether there is none or its robots are out of scope."""
        return cls(f"there is no hook {name[:64]!r}")


class HookExistsError(RequestError):
    """There is a hook of that name already."""

    code = "hook_exists"


class HookRefusedError(RequestError):
    """What was sent to a hook does not prove who sent it: its signature, its time or its token is not good."""

    code = "hook_refused"
