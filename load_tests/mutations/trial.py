"""One mutation against the tests that are near it: the first failure that the fault alone explains."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from load_tests.mutations.faults import Mutation, TreeError, mutated
from load_tests.mutations.runs import Outcome, build_dashboard, check_dashboard, run_tests

__all__ = ["Trial"]

MOST_UNSTEADY = 10  # tests that fail without the fault, too, until a mutation is given up


class Trial:
    """Of one tree, one mutation after the other."""

    def __init__(self, tree: Path, *, timeout_s: float, marks: str, chunk: int) -> None:
        self._tree, self._timeout_s, self._marks, self._chunk = tree, timeout_s, marks, chunk
        self._sound: bool | None = None  # whether the dashboard's check passes as it is

    def run(self, fault: Mutation, files: Sequence[str]) -> dict[str, Any]:
        """What became of it, as the list of results keeps it. Raises TreeError."""
        began_s, unsteady = time.monotonic(), list[str]()
        page = fault.file.startswith("dashboard/")
        by, tests = self._page(fault, files, unsteady) if page else self._found(fault, files, unsteady)
        seconds = round(time.monotonic() - began_s, 1)
        return {"found": bool(by), "by": by, "seconds": seconds, "tests_run": tests, "unsteady": unsteady}

    def _page(self, fault: Mutation, files: Sequence[str], unsteady: list[str]) -> tuple[str, int]:
        """Types and unit tests first; then, with the fault built in, what looks at pages."""
        if self._sound is None:
            self._sound = check_dashboard(self._tree)
        if not self._sound:
            raise TreeError(f"{fault.id}: the dashboard's check fails without any fault")
        with mutated(fault, self._tree):
            if not check_dashboard(self._tree):
                return "check", 0
        return self._found(fault, files, unsteady) if files else ("", 0)

    def _found(self, fault: Mutation, files: Sequence[str], unsteady: list[str]) -> tuple[str, int]:
        """The first test that finds it, "" where none does, and how many ran."""
        total = 0
        for start in range(0, len(files), self._chunk):
            chunk = files[start : start + self._chunk]
            while True:
                outcome = self._mutated(fault, chunk, unsteady)
                total += outcome.tests
                if outcome.good:
                    break
                again = [outcome.failed] if outcome.failed else chunk
                if self._tests(again, ()).good:
                    return outcome.failed or f"{outcome.how}: {' '.join(chunk)}", total
                unsteady.append(outcome.failed or f"{outcome.how}: {' '.join(chunk)}")
                if not outcome.failed or len(unsteady) >= MOST_UNSTEADY:
                    break
            if len(unsteady) >= MOST_UNSTEADY:
                break
        return "", total

    def _mutated(self, fault: Mutation, files: Sequence[str], unsteady: Sequence[str]) -> Outcome:
        with ExitStack() as stack:
            if fault.file.startswith("dashboard/"):
                stack.callback(build_dashboard, self._tree)  # called last, with the file as it was
            stack.enter_context(mutated(fault, self._tree))
            if fault.file.startswith("dashboard/") and not build_dashboard(self._tree):
                return Outcome("", 0, "it does not build")
            return self._tests(files, unsteady)

    def _tests(self, names: Sequence[str], without: Sequence[str]) -> Outcome:
        return run_tests(self._tree, names, timeout_s=self._timeout_s, marks=self._marks, without=without)
