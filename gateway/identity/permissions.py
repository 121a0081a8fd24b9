"""The table of permissions: every route, RPC and socket names a row of it, and nothing else decides.

A row says the least role, whether it is about one robot (which then has to be in the principal's scope), whether it
changes something (then a browser's session needs its CSRF token, and the audit log keeps it), and who may ask at all:
"people" with a role, "anyone" without a credential, "robots" with an identity of their own that is asked for later, or
what was "enrolled": a robot by the token that its link brought it. What people change,
somebody known has changed: nobody anonymous may, whatever the role.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from gateway.domain.principal import Principal, Role

__all__ = ["PERMISSIONS", "Permission", "permission"]


@dataclass(frozen=True, slots=True)
class Permission:
    """One row: `least` counts for people only."""

    name: str
    least: Role
    meaning: str
    robots: bool = False
    mutates: bool = False
    who: Literal["people", "anyone", "robots", "enrolled"] = "people"

    def granted(self, principal: Principal) -> bool:
        """Whether the principal's kind and role suffice; its scope is the caller's to check."""
        if self.who == "anyone":
            return True
        if self.who == "robots":  # nobody known may knock: a robot proves itself in its first frames
            return principal.kind in ("robot", "anonymous")
        if self.who == "enrolled":
            return principal.kind == "robot"
        if principal.kind == "robot" or (self.mutates and principal.kind == "anonymous"):
            return False
        return principal.role >= self.least


_V, _O, _A, _N = Role.VIEWER, Role.OPERATOR, Role.ADMIN, Role.NONE

PERMISSIONS: tuple[Permission, ...] = (
    Permission("health.read", _N, "whether the gateway lives and is ready", who="anyone"),
    Permission("api.read", _N, "the description of this API", who="anyone"),
    Permission("page.read", _N, "the dashboard's files, which hold no data", who="anyone"),
    Permission("sessions.open", _N, "sign in", mutates=True, who="anyone"),
    Permission("sessions.close", _V, "sign out", mutates=True),
    Permission("self.read", _V, "who one is, and what one may do"),
    Permission("self.write", _V, "change one's own password", mutates=True),
    Permission("robots.read", _V, "robots, their topics and links", robots=True),
    Permission("telemetry.read", _V, "live samples, values and series", robots=True),
    Permission("history.read", _V, "stored messages and losses", robots=True),
    Permission("history.export", _V, "stored messages as files", robots=True),
    Permission("recordings.read", _V, "recordings and their files", robots=True),
    Permission("recordings.save", _O, "ask for a clip of a black box", robots=True, mutates=True),
    Permission("recordings.delete", _O, "delete a recording", robots=True, mutates=True),
    Permission("robots.publish", _O, "publish on a robot", robots=True, mutates=True),
    Permission("robots.call", _O, "call a robot's service", robots=True, mutates=True),
    Permission("robots.drive", _O, "drive a robot", robots=True, mutates=True),
    Permission("robots.talk", _O, "talk through a robot's speaker", robots=True, mutates=True),
    Permission("robots.configure", _O, "change a robot's byte budget", robots=True, mutates=True),
    Permission("events.read", _V, "what happened: events of robots, nodes, commands, rollouts"),
    Permission("twin.read", _V, "a robot's desired and reported state, templates", robots=True),
    Permission("twin.write", _O, "change a robot's desired state", robots=True, mutates=True),
    Permission("templates.write", _A, "change what many robots are to be", mutates=True),
    Permission("nodes.read", _V, "a robot's nodes and their logs", robots=True),
    Permission("nodes.control", _O, "start, stop, restart and signal a robot's nodes", robots=True, mutates=True),
    Permission("nodes.code", _A, "change what a robot's nodes run", robots=True, mutates=True),
    Permission("commands.read", _V, "commands to robots and their results", robots=True),
    Permission("commands.send", _O, "send commands, each kind by its own permission too", robots=True, mutates=True),
    Permission("commands.cancel", _O, "take back a command that has not reached its robot", robots=True, mutates=True),
    Permission("updates.read", _V, "versions that robots may be given, and rollouts"),
    Permission("updates.publish", _A, "add versions, and sign what is online", mutates=True),
    Permission("updates.fetch", _N, "a robot's download of signed files", who="enrolled"),
    Permission("rollouts.manage", _A, "start, pause, resume and end rollouts", mutates=True),
    Permission("alerts.read", _V, "alerts, silences and checks, what is watched and expected, backtests", robots=True),
    Permission("alerts.handle", _O, "acknowledge, comment, silence and resolve alerts", robots=True, mutates=True),
    Permission("alerts.manage", _A, "the checks' table, silences of the whole fleet, test notices", mutates=True),
    Permission("rules.read", _V, "rules, schedules, hooks, and what they did"),
    Permission("rules.write", _A, "make, change and delete rules and hooks", mutates=True),
    Permission("happenings.read", _V, "events that rules are about"),
    Permission("happenings.put", _O, "put events", mutates=True),
    Permission("hooks.post", _N, "a webhook, which proves by itself who sent it", who="anyone"),
    Permission("functions.read", _V, "functions, their versions, aliases, layers, logs and calls"),
    Permission("functions.invoke", _O, "call functions", mutates=True),
    Permission("functions.write", _A, "make, change and delete functions and what belongs to them", mutates=True),
    Permission("dead_letters.read", _V, "what could not be delivered, and replays", robots=True),
    Permission("dead_letters.write", _O, "deliver dead letters again, or drop them", robots=True, mutates=True),
    Permission("functions.fetch", _N, "a function's code, by a link that was signed a moment ago", who="anyone"),
    Permission("lambda.call", _V, "the Lambda API, each operation by its own permission too"),
    Permission("store.read", _V, "what the store holds and will delete"),
    Permission("keys.own", _V, "make, list and revoke one's own keys", mutates=True),
    Permission("tickets.make", _V, "make a short-lived ticket for a viewer", mutates=True),
    Permission("keys.manage", _A, "everybody's keys", mutates=True),
    Permission("users.manage", _A, "users, their roles and robots", mutates=True),
    Permission("robots.enrol", _A, "make and list enrolment tokens", mutates=True),
    Permission("robots.revoke", _A, "end a robot's identity", robots=True, mutates=True),
    Permission("metrics.read", _V, "what the gateway counts, for Prometheus"),
    Permission("debug.read", _A, "the gateway's report for a bug"),
    Permission("audit.read", _A, "the audit log and its verification"),
    Permission("agent.enrol", _N, "a robot's first certificate, by a token", mutates=True, who="anyone"),
    Permission("agent.link", _N, "a robot's link, by its identity", who="robots"),
)

_BY_NAME = {row.name: row for row in PERMISSIONS}


def permission(name: str) -> Permission:
    """The row of that name; KeyError for one that the table lacks, which is a mistake of ours."""
    return _BY_NAME[name]
