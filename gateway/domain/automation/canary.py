"""A canary: a new version of a function that an alias leads to now and then, until it has shown what it is. Pure."""

from __future__ import annotations

from dataclasses import dataclass, replace

__all__ = ["CANCELLED", "PROMOTED", "ROLLED_BACK", "RUNNING", "Canary", "judged"]

RUNNING, PROMOTED, ROLLED_BACK, CANCELLED = "running", "promoted", "rolled_back", "cancelled"


@dataclass(frozen=True, slots=True, kw_only=True)
class Canary:
    """`version` gets `weight` (0 to 1) of an alias' calls, `stable` the others.

    It is rolled back as soon as more than `error_rate` of its calls failed, of `least_invocations` at least. After
    `for_s` without that it gets `step` more, and all in the end; with `step` 0 all at once. `invocations` and
    `errors` are those of this step. `applied`: the alias is as the state says.
    """

    function: str
    alias: str
    version: str
    stable: str
    weight: float
    error_rate: float
    least_invocations: int
    for_s: float
    step: float = 0.0
    state: str = RUNNING
    reason: str = ""
    by: str = ""
    began_ns: int = 0
    changed_ns: int = 0
    invocations: int = 0
    errors: int = 0
    applied: bool = False
    revision: int = 0

    @property
    def weights(self) -> tuple[str, dict[str, float]]:
        """What the alias is to be: its version, and the shares of others."""
        if self.state == RUNNING:
            return self.stable, {self.version: self.weight}
        return (self.version if self.state == PROMOTED else self.stable), {}


def judged(canary: Canary, *, invocations: int, errors: int, now_ns: int) -> Canary:
    """The canary after some more calls of its version, at a time."""
    if canary.state != RUNNING:
        return canary
    now = replace(canary, invocations=canary.invocations + invocations, errors=canary.errors + errors)
    enough = now.invocations >= max(1, now.least_invocations)
    if enough and now.errors > now.error_rate * now.invocations:
        most = f"more than {100 * now.error_rate:.3g} %"
        said = f"{now.errors} of {now.invocations} calls of version {now.version} failed, {most}"
        return replace(now, state=ROLLED_BACK, reason=said, changed_ns=now_ns, applied=False)
    if not enough or now_ns - now.changed_ns < now.for_s * 1e9:
        return now
    weight = min(1.0, now.weight + now.step) if now.step else 1.0
    said = f"{now.errors} of {now.invocations} calls failed in {(now_ns - now.changed_ns) / 1e9:.0f} s"
    if weight > 1.0 - 1e-9:
        return replace(now, state=PROMOTED, reason=said, changed_ns=now_ns, applied=False)
    return replace(now, weight=weight, reason=said, changed_ns=now_ns, invocations=0, errors=0, applied=False)
