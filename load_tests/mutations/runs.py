"""Tests of a tree, run by the tree's own interpreter: which one failed first, and how many ran."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

__all__ = ["Outcome", "build_dashboard", "check_dashboard", "run_tests"]

NOTHING_RAN = 5  # pytest's exit code
DASHBOARD_S = 1800.0
_UNSHRUNK = """
from hypothesis import Phase, settings

def pytest_configure(config):
    now = settings.get_current_profile_name()
    settings.register_profile("unshrunk", settings.get_profile(now), phases=(Phase.explicit, Phase.generate))
    settings.load_profile("unshrunk")
"""  # the first example that fails is enough; to make it small took minutes


@dataclass(frozen=True, slots=True)
class Outcome:
    """`failed` is the first test that failed, "" for none; `how` tells what ended the run where no test did."""

    failed: str
    tests: int
    how: str = ""

    @property
    def good(self) -> bool:
        """Whether all went well."""
        return not self.failed and not self.how


def run_tests(
    tree: Path, names: Sequence[str], *, timeout_s: float, marks: str, without: Sequence[str] = ()
) -> Outcome:
    """One pytest over some files or tests, up to the first failure; `without` are tests left out."""
    with tempfile.TemporaryDirectory(prefix="mutation-") as folder:
        report = Path(folder) / "report.xml"
        Path(folder, "unshrunk.py").write_text(_UNSHRUNK)
        command = [_python(tree), "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-o", "junit_family=xunit1"]
        command += ["-p", "unshrunk"]
        command += [f"--junitxml={report}", *(["-m", marks] if marks else [])]
        command += [f"--deselect={name}" for name in without]
        code = _run([*command, *names], tree, timeout_s, PYTHONPATH=folder)
        tests, failed = _read(report)
    if code in (0, NOTHING_RAN):
        return Outcome("", tests)
    if code is None:
        return Outcome("", tests, "time is over")
    return Outcome(failed, tests, "" if failed else f"pytest ended with {code}")


def check_dashboard(tree: Path) -> bool:
    """Whether the dashboard's types and unit tests are right."""
    return _run([_python(tree), "tools/dashboard.py", "check"], tree, DASHBOARD_S) == 0


def build_dashboard(tree: Path) -> bool:
    """Build it into gateway/static; False where it does not build."""
    return _run([_python(tree), "tools/dashboard.py", "build"], tree, DASHBOARD_S) == 0


def _python(tree: Path) -> str:
    return str(tree / ".venv" / "bin" / "python")


def _run(command: Sequence[str], tree: Path, timeout_s: float, **more: str) -> int | None:
    """The exit code, None where time was over; what the program started ends with it."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"} | more
    with tempfile.TemporaryFile() as said:
        program = subprocess.Popen(
            command, cwd=tree, env=environment, stdin=subprocess.DEVNULL, stdout=said, stderr=said,
            start_new_session=True,
        )  # fmt: skip
        try:
            code = program.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return None
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(program.pid, signal.SIGKILL)
            program.wait()
        if code not in (0, 1, NOTHING_RAN):
            said.seek(0)
            sys.stderr.write(said.read().decode(errors="replace")[-2000:])
        return code


def _read(report: Path) -> tuple[int, str]:
    """How many tests ran, and the id of the first that failed."""
    try:
        cases = list(ElementTree.parse(report).iter("testcase"))
    except (OSError, ElementTree.ParseError):  # pytest was killed
        return 0, ""
    ran = [case for case in cases if case.find("skipped") is None]
    bad = [case for case in ran if case.find("failure") is not None or case.find("error") is not None]
    return len(ran), _id_of(bad[0]) if bad else ""


def _id_of(case: ElementTree.Element) -> str:
    """As pytest takes it; of a file that cannot be imported, the file."""
    name, place, file = case.get("name", ""), case.get("classname", ""), case.get("file", "")
    if not place:
        return file or f"{name.replace('.', '/')}.py"
    file = file or f"{place.replace('.', '/')}.py"
    module = file.removesuffix(".py").replace("/", ".")
    classes = [part for part in place.removeprefix(module).split(".") if part]
    return "::".join([file, *classes, name])
