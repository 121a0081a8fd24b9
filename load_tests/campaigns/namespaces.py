"""Campaigns that need namespaces: each part is a process inside `unshare`, its last line is its result as JSON."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Sequence
from typing import Any

from tests.support.processes.netns import INSIDE
from tests.support.robots.checker import Verdict

__all__ = ["Show", "result", "run_parts"]

Show = Callable[[str, dict[str, Any]], bool]  # prints a part's line; whether it passed


def result(verdict: Verdict, **facts: Any) -> int:
    """Print a part's result, and its exit code."""
    for problem in verdict.problems[:10]:
        print(problem)
    names = ("accepted", "rows", "declared", "lost", "duplicate", "wrong", "unaccepted")
    print(json.dumps({**{name: getattr(verdict, name) for name in names}, **facts}), flush=True)
    return int(not verdict.good)


def run_parts(module: str, parts: Sequence[str], options: Sequence[str], *, parallel: int, show: Show) -> int:
    """All parts, a few at a time, and the exit code."""
    good, waiting, running = True, list(parts), dict[str, subprocess.Popen[str]]()
    try:
        while waiting or running:
            while waiting and len(running) < parallel:
                part = waiting.pop(0)
                command = [*INSIDE, sys.executable, "-m", module, "--inside", part, *options]
                running[part] = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            part = next(iter(running))
            output, _ = running[part].communicate()
            good = shown(part, output, running.pop(part).returncode, show) and good
    finally:
        for process in running.values():
            process.kill()
            process.communicate()
    print("  PASS" if good else "  FAIL", flush=True)
    return int(not good)


def shown(part: str, output: str, code: int, show: Show) -> bool:
    """Show a part; whether it passed."""
    lines = output.strip().splitlines()
    try:
        facts = json.loads(lines[-1])
    except (IndexError, ValueError):
        print(f"{part:>10}  did not end (exit {code}):\n{output[-3000:]}")
        return False
    passed = show(part, facts) and code == 0
    print("".join(f"    {line}\n" for line in lines[:-1]), end="", flush=True)
    return passed
