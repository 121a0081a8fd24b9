"""When to start a process again: a pure function over its history.

The first restart comes at once, the following ones after a doubling, jittered delay; a process that stayed healthy for
a while starts from the beginning again. One that keeps dying is put in quarantine, from which it is tried again once
now and then, until it stays healthy; a critical one is never given up, but each further death asks for a safe stop.
Exit code 78 (`EX_CONFIG`) means that the configuration is wrong: trying again would only repeat the message.
"""

from __future__ import annotations

import signal
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from random import Random  # noqa: TID251  (the type of an argument)

__all__ = [
    "CONFIG_EXIT_CODE",
    "Decision",
    "Exit",
    "History",
    "Quarantine",
    "Restart",
    "RestartAt",
    "RestartPolicy",
    "Stop",
    "decide",
]

CONFIG_EXIT_CODE = 78


class Restart(StrEnum):
    """Which exits call for a restart; the words are systemd's."""

    ALWAYS = "always"
    ON_FAILURE = "on-failure"
    NEVER = "never"


@dataclass(frozen=True, slots=True, kw_only=True)
class RestartPolicy:
    """The numbers of the policy, in seconds and counts."""

    restart: Restart = Restart.ALWAYS
    critical: bool = False
    first_jitter_s: float = 0.05  # the first restart comes after 0 to this
    base_delay_s: float = 0.1  # the second one after this, then doubled
    max_delay_s: float = 30.0
    jitter: float = 0.2  # each delay varies by this share, so that a fleet does not restart in step
    healthy_after_s: float = 60.0  # a run of this length clears the count of restarts
    window_s: float = 300.0
    window_exits: int = 10  # more exits than this within the window is a crash loop
    quarantine_s: float = 300.0


@dataclass(frozen=True, slots=True)
class Exit:
    """How a process ended: by its own exit code, or by a signal."""

    code: int | None = None
    signal: int | None = None

    @classmethod
    def from_returncode(cls, returncode: int) -> Exit:
        """Read what `subprocess` reports: a negative number is a signal."""
        return cls(signal=-returncode) if returncode < 0 else cls(code=returncode)

    @property
    def clean(self) -> bool:
        """True for exit code 0."""
        return self.code == 0

    @property
    def reason(self) -> str:
        """In words, for one line of output."""
        if self.signal is None:
            return "exited" if self.clean else f"exit code {self.code}"
        try:
            return f"killed by {signal.Signals(self.signal).name}"
        except ValueError:
            return f"killed by signal {self.signal}"


@dataclass(frozen=True, slots=True)
class History:
    """What the policy remembers of one process; `started` and `exited` give the next history."""

    started_at: float | None = None
    exits: tuple[float, ...] = ()
    restarts: int = 0  # since the process was last healthy
    quarantined: bool = False  # it was, and has not been healthy since: one try at a time

    def started(self, now: float) -> History:
        """The process was started at `now`."""
        return replace(self, started_at=now)

    def exited(self, now: float, policy: RestartPolicy) -> History:
        """The process ended at `now`; forgets what is out of the window, and all after a healthy run."""
        healthy = self.started_at is not None and now - self.started_at >= policy.healthy_after_s
        exits = tuple(at for at in self.exits if now - at <= policy.window_s)
        return History(None, (*exits, now), 0 if healthy else self.restarts, self.quarantined and not healthy)

    def restarted(self) -> History:
        """One more restart was granted."""
        return replace(self, restarts=self.restarts + 1)


@dataclass(frozen=True, slots=True)
class RestartAt:
    """Start again at this reading of the monotonic clock; `safe_stop` asks the owner to bring the machine to rest."""

    at: float
    safe_stop: bool = False


@dataclass(frozen=True, slots=True)
class Quarantine:
    """A crash loop: raise an alarm, and try again only at `until`."""

    until: float
    exits: int


@dataclass(frozen=True, slots=True)
class Stop:
    """Do not start again."""

    reason: str


Decision = RestartAt | Quarantine | Stop


def decide(
    history: History, exit_: Exit, now: float, rng: Random, policy: RestartPolicy | None = None
) -> tuple[Decision, History]:
    """What to do after this exit, and the history to go on with."""
    policy = policy or RestartPolicy()
    after = history.exited(now, policy)
    if stop := _final(exit_, policy):
        return stop, after
    looping = after.quarantined or len(after.exits) > policy.window_exits
    if looping and not policy.critical:
        after = replace(after.restarted(), quarantined=True)
        return Quarantine(now + policy.quarantine_s, len(after.exits)), after
    return RestartAt(now + _delay_s(after.restarts, rng, policy), safe_stop=looping), after.restarted()


def _final(exit_: Exit, policy: RestartPolicy) -> Stop | None:
    if exit_.code == CONFIG_EXIT_CODE:
        return Stop("its configuration is wrong (exit code 78)")
    if policy.restart is Restart.NEVER:
        return Stop("it is not to be restarted")
    if policy.restart is Restart.ON_FAILURE and exit_.clean:
        return Stop("it finished")
    return None


def _delay_s(restarts: int, rng: Random, policy: RestartPolicy) -> float:
    if restarts == 0:
        return rng.uniform(0.0, policy.first_jitter_s)
    exponent = min(restarts - 1, 62)  # 2.0**62 is far above any cap and far below an overflow
    delay = min(policy.base_delay_s * 2.0**exponent, policy.max_delay_s)
    return delay * rng.uniform(1.0 - policy.jitter, 1.0 + policy.jitter)
