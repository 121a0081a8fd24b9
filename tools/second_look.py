"""Run the tests that failed in the last run once more, alone: `python tools/second_look.py`.

Eight thousand tests share two cores in CI, with browsers, databases and killed processes among them, and a machine that
stalls for a second makes one of them fail by its clock. At most `FEW` failures get this second look; they are named
either way, since a test that needs it has a race that somebody has to mend. Failing again fails the run.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

__all__ = ["failed_tests", "main"]

FEW = 8
ROOT = Path(__file__).resolve().parent.parent


def failed_tests(cache: Path) -> list[str]:
    """The tests that pytest's cache says failed in the last run; none where there is no such run."""
    try:
        found = json.loads((cache / "v/cache/lastfailed").read_text())
    except (OSError, ValueError):
        return []
    return sorted(found) if isinstance(found, dict) else []


def main(root: Path = ROOT) -> int:
    """0 when all of a few failed tests pass alone; 1 when there were none to look at, too many, or one fails again."""
    failed = failed_tests(root / ".pytest_cache")
    if not 0 < len(failed) <= FEW:
        print(f"second look: none, since {len(failed)} failed (at most {FEW} get one)")
        return 1
    for test in failed:
        print(f"second look: {test}", flush=True)
    again = subprocess.run([sys.executable, "-m", "pytest", *failed], cwd=root, check=False)
    if again.returncode == 0:
        print(f"UNSTEADY, to be mended: failed among the others, passed alone: {', '.join(failed)}")
    return 1 if again.returncode else 0


if __name__ == "__main__":
    sys.exit(main())
