"""Automatic rollback of node bundles: a new version has to prove itself, else the last good one runs again. Pure.

What each node's good version is, and which one failed, is kept on disk by the manager.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

__all__ = ["VersionTrial"]

EXITS: Final = 3  # so many of the new version end the trial


@dataclass(slots=True)
class VersionTrial:
    """The versions of one node's bundle. `good` has proved itself, `failed` has not; "" = none."""

    bundle: str
    good: str = ""
    failed: str = ""
    trying: str = ""
    code: str = ""
    message: str = ""
    began_s: float = 0.0
    crashes: int = 0  # that the supervisor had counted when the trial began
    seen: bool = False  # the supervisor runs the version that is tried

    def choose(self, wanted: str) -> str:
        """The version to run for a wanted one: that, or the good one where it has failed before."""
        if wanted == self.failed and self.good:
            return self.good
        return wanted

    def forgive(self, wanted: str) -> None:
        """Another version is wanted than the one that failed: it may be tried again later."""
        if self.failed and wanted != self.failed:
            self.failed = self.code = self.message = ""

    def begin(self, version: str) -> None:
        """This version is in the table now."""
        if version in (self.good, self.trying):
            self.trying = "" if version == self.good else self.trying
            return
        self.trying, self.seen = version, False

    def evaluate(self, node: Mapping[str, Any], *, now_s: float, wall_ns: int, health_s: float, trial_s: float) -> str:
        """`healthy` or `rolled_back` when that is settled now, else nothing. `node` is the supervisor's row."""
        if not self.trying or node.get("version") != self.trying:
            return ""
        if not self.seen:
            self.seen, self.began_s, self.crashes = True, now_s, int(node.get("crashes_total", 0))
        state, exits = node.get("state"), int(node.get("crashes_total", 0)) - self.crashes
        if state == "stopped":  # not to run, or no lease: it cannot prove anything
            self.began_s = now_s
            return ""
        ran_s = (wall_ns - int(node.get("since_ns") or wall_ns)) / 1e9
        if state == "running" and ran_s >= health_s and now_s - self.began_s >= health_s:
            self.good, self.trying, self.failed = self.trying, "", ""
            self.code = self.message = ""
            return "healthy"
        gave_up = state in ("quarantined", "ended") and node.get("last_exit") != "exited"
        if exits >= EXITS or gave_up or now_s - self.began_s > trial_s:
            self.failed, self.trying = self.trying, ""
            self.code = "node_unhealthy"
            self.message = f"{self.failed}: {exits} exits, last: {node.get('last_exit') or 'none'}"[:300]
            return "rolled_back"
        return ""

    def update(self, wanted: str, *, fetching: bool, problem: tuple[str, str] = ("", "")) -> dict[str, str]:
        """Section `update` of a reported node."""
        if problem[0]:
            state, code, message = "refused", *problem
        elif wanted == self.failed:
            state, code, message = "rolled_back", self.code, self.message
        else:
            state = "downloading" if fetching else "trying" if self.trying == wanted else "healthy"
            state = state if fetching or self.trying == wanted or self.good == wanted else "staged"
            code = message = ""
        return {"state": state, "version": wanted, "code": code, "message": message}
