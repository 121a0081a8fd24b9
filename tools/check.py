"""`make check`: every check, two at once, the longest first; what each says is kept together, and all are heard."""

from __future__ import annotations

import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
AT_ONCE = 2
CHECKS = (
    "mypy",
    "python tools/dashboard.py check",
    "python tools/gen_ts_client.py --check",
    "python tools/gen_permissions.py --check",
    "lint-imports",
    "python tools/gen_interfaces.py --check",
    "python tools/gen_proto.py --check",
    "python tools/gen_drivers.py --check",
    "ruff check .",
    "ruff format --check .",
)


def passes(command: str) -> bool:
    """Run one to its end with this environment's programs, then say at once what it said."""
    program, *words = command.split()
    began_s = time.monotonic()
    done = subprocess.run(
        [Path(sys.executable).with_name(program), *words],
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    ending = "" if done.returncode == 0 else f", FAILED with {done.returncode}"
    print(f"{command} ({time.monotonic() - began_s:.1f} s{ending})\n{done.stdout}", end="", flush=True)
    return done.returncode == 0


def main() -> int:
    """1 where any check failed."""
    with ThreadPoolExecutor(AT_ONCE) as pool:
        return 0 if all(list(pool.map(passes, CHECKS))) else 1


if __name__ == "__main__":
    raise SystemExit(main())
