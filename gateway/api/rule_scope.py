"""Authorization of rules and hooks by scope: who may see a rule, and what its targets may do.

A rule goes by the scope of who made it. It is shown to whoever sees, for certain, every robot of that scope.
"""

from __future__ import annotations

from starlette.requests import Request

from gateway.api.authorization import principal_of
from gateway.api.services import services_of
from gateway.api.silence_scope import covers
from gateway.automation.rules.errors import RuleInvalidError, UnknownHookError, UnknownRuleError
from gateway.automation.rules.rule import Rule
from gateway.automation.rules.target_kinds import target_kind
from gateway.domain.automation.rule import Hook, StoredRule
from gateway.domain.principal import Principal
from gateway.errors import ForbiddenError, InvalidRequestError
from gateway.fleet.kinds import kind_of
from gateway.identity.permissions import permission

__all__ = ["check_targets", "seen_hook", "seen_rule", "sees_hook", "sees_rule"]


def sees_rule(principal: Principal, stored: StoredRule) -> bool:
    """Whether the principal may know of it."""
    return covers(principal, stored.maker.robots)


def sees_hook(principal: Principal, hook: Hook) -> bool:
    """Whether the principal may know of it."""
    return principal.sees(hook.robot) if hook.robot else covers(principal, hook.robots)


def seen_rule(request: Request, name: str) -> StoredRule:
    """One rule; UnknownRuleError also where it is out of scope."""
    stored = services_of(request).rules.registry.get(name)
    if not sees_rule(principal_of(request), stored):
        raise UnknownRuleError.of(name)
    return stored


async def seen_hook(request: Request, name: str) -> Hook:
    """One hook; UnknownHookError also where it is out of scope."""
    hook = await services_of(request).rules.hooks.get(name)
    if not sees_hook(principal_of(request), hook):
        raise UnknownHookError.of(name)
    return hook


def check_targets(principal: Principal, rule: Rule) -> None:
    """ForbiddenError where a rule would do what its maker may not; RuleInvalidError for a kind of command that is none.

    A target that its own document gives a credential of the robot (a lease) is its maker's all the same.
    """
    for place, target in enumerate(rule.targets):
        names = [target_kind(target.kind, "kind").permission]
        if target.kind == "command":
            try:
                names.append(kind_of(str(target.fields["command"])).permission)
            except InvalidRequestError as error:
                raise RuleInvalidError(f"targets[{place}].command", str(error)) from error
        for name in names:
            row = permission(name)
            if not row.granted(principal):
                raise ForbiddenError(f"targets[{place}]: {row.name} needs the role {row.least.word} or more")
