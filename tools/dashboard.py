"""`build` the dashboard or `check` it (circles, types, unit tests), with Node from PyPI where the machine has none."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import hatch_build


def ensure_node() -> None:
    """Install Node's PyPI wheel into this environment if the machine has no Node that is new enough."""
    if hatch_build._system_npm() or hatch_build._wheel_npm():
        return
    print("metaros: no Node on this machine; taking it from PyPI (60 MB, once)", flush=True)
    install = [sys.executable, "-m", "pip", "install", "-q", "--disable-pip-version-check", hatch_build.NODE_WHEEL]
    subprocess.run(install, check=True)


def main(arguments: list[str]) -> int:
    """`build` or `check`; exit code 1 with the reason when it fails."""
    if arguments not in (["build"], ["check"]):
        print("usage: python tools/dashboard.py build|check", file=sys.stderr)
        return 2
    try:
        if arguments == ["build"]:
            if not hatch_build.is_fresh(hatch_build.ROOT):
                print("metaros: building the dashboard", flush=True)
                ensure_node()
                hatch_build.build(hatch_build.ROOT)
        else:
            ensure_node()
            for script in ("circles", "check", "test"):
                hatch_build.run_script(hatch_build.ROOT, script)
                print(f"dashboard: npm run {script} passed")
    except (hatch_build.DashboardBuildError, subprocess.CalledProcessError) as error:
        print(f"metaros: dashboard: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
