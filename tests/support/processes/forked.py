"""Programs that are about how they end: real processes, whose imports are paid for once."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from tests.support.processes.processes import END_S, started

__all__ = ["ended", "forked"]

ROOT = Path(__file__).resolve().parents[3]
PROGRAM = """
import json, os, sys
{imports}
children = {{}}
for number, code in enumerate(json.loads(sys.argv[1])):
    children[number] = os.fork()  # before anything of Zenoh's has begun, and while there is one thread
    if not children[number]:
        break
else:
    print({{number: os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) for number, pid in children.items()}})
    sys.exit()
exec(code)
"""


@contextmanager
def forked(codes: Sequence[str], *, imports: str) -> Iterator[subprocess.Popen[str]]:
    """Each code is a program of its own, which knows its `number`; they run beside each other."""
    argv = [sys.executable, "-c", PROGRAM.format(imports=imports), json.dumps(list(codes))]
    with started(argv, cwd=ROOT) as process:
        yield process


def ended(process: subprocess.Popen[str], *, ready: bool = False) -> tuple[dict[int, int], str]:
    """The exit code of each, and what they complained of; `ready`: each has printed that it was."""
    out, err = process.communicate(timeout=END_S)
    *lines, codes = out.splitlines()
    found: dict[int, int] = ast.literal_eval(codes)
    assert "".join(lines) == "ready" * (len(found) if ready else 0), f"{out}\n{err}"  # unbuffered, lines mix
    return found, err
