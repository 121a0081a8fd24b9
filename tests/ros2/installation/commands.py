"""A real installation of ROS 2: its environment, and its commands as processes."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Sequence
from pathlib import Path

__all__ = ["Installation", "Running"]

KEPT = ("HOME", "LANG", "LC_ALL", "LOGNAME", "SHELL", "TERM", "TMPDIR", "USER")
TIMEOUT_S = 60.0


class Running:
    """A command that goes on, and what it has printed so far."""

    def __init__(self, arguments: Sequence[str], environment: dict[str, str], output: Path) -> None:
        self._output = output
        with output.open("wb") as file:
            self._process = subprocess.Popen(
                arguments, env=environment, stdout=file, stderr=subprocess.STDOUT, start_new_session=True
            )

    def text(self) -> str:
        """What it has printed."""
        return self._output.read_text(errors="replace")

    def wait(self) -> str:
        """Until it ends by itself; all that it printed."""
        self._process.wait(TIMEOUT_S)
        return self.text()

    def stop(self) -> None:
        """As Ctrl-C in a terminal does: for all that it started, too. Who does not listen is killed."""
        try:
            os.killpg(self._process.pid, signal.SIGINT)
            self._process.wait(5)
            os.killpg(self._process.pid, signal.SIGKILL)  # who is left: `ros2 run` may end before its node
        except ProcessLookupError:
            pass
        except subprocess.TimeoutExpired:
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()


class Installation:
    """`folder` has a setup.bash. Nodes find each other by `router`, and nothing of our virtual environment is seen."""

    def __init__(self, folder: str | Path, router: str, outputs: Path) -> None:
        script = Path(folder) / "setup.bash"
        if not script.is_file():
            raise FileNotFoundError(f"{script}: ROS= is the folder of an installation, such as /opt/ros/jazzy")
        self._outputs, self._count = outputs, 0
        self.environment = _sourced(script) | {
            "RMW_IMPLEMENTATION": "rmw_zenoh_cpp",
            "ROS_DOMAIN_ID": "0",
            "ZENOH_CONFIG_OVERRIDE": f'connect/endpoints=["{router}"]',
            "ZENOH_ROUTER_CHECK_ATTEMPTS": "10",
            "PYTHONUNBUFFERED": "1",
            "RCUTILS_COLORIZED_OUTPUT": "0",
        }

    def start(self, *arguments: str) -> Running:
        """A command, which goes on."""
        self._count += 1
        return Running(arguments, self.environment, self._outputs / f"{self._count}.txt")

    def ask(self, *arguments: str) -> str:
        """A command that ends: what it prints, complaints too."""
        done = subprocess.run(
            arguments, env=self.environment, capture_output=True, text=True, errors="replace", timeout=TIMEOUT_S
        )
        return done.stdout + done.stderr

    def look(self, *arguments: str) -> str:
        """The same for what looks at the graph: by itself, since a daemon would know another graph."""
        text = self.ask(*arguments, "--no-daemon", "--spin-time", "2")
        return self.ask(*arguments) if "unrecognized arguments" in text else text


def _sourced(script: Path) -> dict[str, str]:
    """The environment that a terminal has after `source setup.bash`."""
    plain = {name: os.environ[name] for name in KEPT if name in os.environ}
    plain["PATH"] = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
    told = subprocess.run(
        ["bash", "-c", 'source "$0" >/dev/null && env -0', str(script)],
        env=plain,
        capture_output=True,
        check=True,
        timeout=TIMEOUT_S,
    )
    rows = told.stdout.decode(errors="replace").split("\0")
    return dict(row.split("=", 1) for row in rows if "=" in row)
