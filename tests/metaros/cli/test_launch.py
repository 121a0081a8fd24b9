"""`metaros launch` with real nodes: killed, crashing, hanging, orphaned, asked from another terminal."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil
import pytest

from tests.support.ports import free_port
from tests.support.waiting import wait_until

LONG_S = 60.0
TALKER = """
    import os
    import metaros
    from metaros.interfaces.std_msgs.msg import String

    with metaros.Node("anything") as node:
        word = node.declare_parameter("word", "nothing")
        publisher = node.create_publisher(String, "chatter")
        print(f"pid={os.getpid()} {node.full_name} {publisher.topic} {word}", flush=True)
        publisher.publish(String(data=word))
        metaros.spin(node)
"""
HANGER = """
    import time
    import metaros

    class Hanger(metaros.Node):
        def __init__(self):
            super().__init__("hanger")
            self.beats = 0
            self.create_timer(0.05, self.tick)

        def tick(self):
            self.beats += 1
            if self.beats == 20:
                print("hanging now", flush=True)
                time.sleep(3600)
"""


class Launcher:
    """A running `metaros launch`, its output, and requests to it."""

    def __init__(self, folder: Path, table: str, **modules: str) -> None:
        self.folder = folder
        self.port = str(free_port())
        self.out = folder / "out.txt"
        (folder / "robot.toml").write_text(textwrap.dedent(table))
        for name, code in modules.items():
            (folder / f"{name}.py").write_text(textwrap.dedent(code))
        options = ["--zenoh-port", self.port, "--log-dir", str(folder / "logs")]
        command = [sys.executable, "-m", "metaros", "launch", str(folder / "robot.toml"), *options]
        with self.out.open("wb") as out:
            self.process = subprocess.Popen(command, stdout=out, stderr=out)

    def text(self) -> str:
        return self.out.read_text()

    def said(self, text: str, times: int = 1) -> None:
        wait_until(lambda: self.text().count(text) >= times or self._ended(text), timeout_s=LONG_S)

    def _ended(self, text: str) -> bool:
        if self.process.poll() is not None:
            raise AssertionError(f"the launcher ended before it said {text!r}:\n{self.text()}")
        return False

    def ask(self, *words: str) -> Any:
        command = [sys.executable, "-m", "metaros", "launch", *words, "--zenoh-port", self.port, "-o", "json"]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LONG_S)
        return json.loads(done.stdout) if done.returncode == 0 else done.stderr

    def pid(self, name: str) -> int:
        (pid,) = (row["pid"] for row in self.ask("status")[0]["nodes"] if row["name"] == name)
        assert isinstance(pid, int)
        return pid

    def end(self) -> int:
        """Ctrl-C, and the exit code."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(LONG_S)


@contextmanager
def launcher(folder: Path, table: str, **modules: str) -> Iterator[Launcher]:
    running = Launcher(folder, table, **modules)
    try:
        yield running
    finally:
        if running.process.poll() is None:
            running.process.kill()
        running.process.wait()


def check(path: Path, *options: str) -> tuple[int, str]:
    command = [sys.executable, "-m", "metaros", "launch", str(path), *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LONG_S)
    return done.returncode, done.stdout + done.stderr


def _alive(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_kill_9_of_a_node_brings_another_with_its_name_and_parameters(tmp_path: Path) -> None:
    table = """
        [[node]]
        name = "talker"
        module = "talker"
        namespace = "/r"
        parameters = { word = "it's: [a] word" }
        remap = { chatter = "talk" }
    """
    line = "/r/talker /r/talk it's: [a] word"
    with launcher(tmp_path, table, talker=TALKER) as running:
        running.said(line)
        first = running.pid("talker")
        os.kill(first, signal.SIGKILL)
        running.said(line, times=2)
        assert running.pid("talker") != first
        assert "killed by SIGKILL" in running.text()
        assert running.end() == 0
    assert (tmp_path / "logs" / "talker.log").read_text().count(line) == 2


@pytest.mark.integration
def test_eleven_crashes_are_a_quarantine_with_a_reason_until_restart_is_asked(tmp_path: Path) -> None:
    table = """
        [[node]]
        name = "crasher"
        module = "crasher"
        restart = { base_delay_s = 0.0, max_delay_s = 0.0 }
        [[node]]
        name = "watcher"
        module = "watcher"
    """
    watcher = """
        import metaros
        from metaros.interfaces.metaros_msgs.msg import NodeEvent

        qos = metaros.QoSProfile(depth=64, durability=metaros.Durability.TRANSIENT_LOCAL)
        with metaros.Node("watcher") as node:
            say = lambda event: print(f"heard {event.node} {event.kind} {event.restarts}", flush=True)
            node.create_subscription(NodeEvent, "/metaros/node_events", say, qos)
            metaros.spin(node)
    """
    with launcher(tmp_path, table, crasher="raise RuntimeError('no motor')", watcher=watcher) as running:
        running.said("quarantined")
        assert running.text().count("RuntimeError: no motor") >= 11
        assert "11 exits within 300 s" in running.text()
        running.said("heard /crasher node_restarted 10")
        running.said("heard /crasher quarantined")
        (row,) = (row for row in running.ask("status")[0]["nodes"] if row["name"] == "crasher")
        assert (row["state"], row["last_exit"]) == ("quarantined", "exit code 1")
        running.ask("restart", "crasher")
        running.said("✗ quarantined", times=2)


@pytest.mark.skipif(sys.platform != "linux", reason="the parent-death signal is Linux's")
def test_kill_9_of_the_launcher_leaves_no_child(tmp_path: Path) -> None:
    table = f"""
        [[node]]
        name = "talker"
        module = "talker"
        [[node]]
        name = "sleeper"
        command = [{json.dumps(sys.executable)}, "-c", "import time; print('asleep', flush=True); time.sleep(3600)"]
    """
    with launcher(tmp_path, table, talker=TALKER) as running:
        running.said("/talker")
        running.said("asleep")
        pids = [row["pid"] for row in running.ask("status")[0]["nodes"]]
        running.process.kill()
        running.process.wait()
        wait_until(lambda: not any(_alive(pid) for pid in pids), timeout_s=LONG_S)


def test_a_node_whose_callback_hangs_is_ended_and_restarted(tmp_path: Path) -> None:
    table = """
        heartbeat_s = 1.0
        [[node]]
        name = "hanger"
        class = "hanger:Hanger"
    """
    with launcher(tmp_path, table, hanger=HANGER) as running:
        running.said("hanging now")
        running.said("hung: no heartbeat for")
        running.said("restarted, time 1")
        running.said("hanging now", times=2)


@pytest.mark.integration
def test_requests_from_another_terminal(tmp_path: Path) -> None:
    table = """
        [[node]]
        name = "talker"
        module = "talker"
        [[node]]
        name = "other"
        module = "talker"
    """
    with launcher(tmp_path, table, talker=TALKER) as running:
        running.said("/talker")
        running.said("/other")
        (answer,) = running.ask("stop", "other")
        assert {row["name"]: row["state"] for row in answer["nodes"]} == {"talker": "running", "other": "stopped"}
        running.ask("restart", "other")
        running.said("/other", times=2)
        assert "no launcher has a node 'nobody'; there are: talker, other" in running.ask("stop", "nobody")
        assert "which node?" in running.ask("restart")
        assert running.end() == 0


def test_exit_code_78_is_final_and_a_table_of_failures_fails(tmp_path: Path) -> None:
    table = """
        [[node]]
        name = "wrong"
        class = "wrong:Nobody"
    """
    with launcher(tmp_path, table, wrong="x = 1") as running:
        assert running.process.wait(LONG_S) == 1
        assert "module wrong has no class Nobody" in running.text()
        assert "not started again: its configuration is wrong" in running.text()


def test_a_critical_node_that_keeps_dying_calls_for_a_safe_stop(tmp_path: Path) -> None:
    stop = "import os; open('stopped', 'w').write(os.environ['METAROS_NODE'])"
    table = f"""
        safe_stop = [{json.dumps(sys.executable)}, "-c", {json.dumps(stop)}]
        [[node]]
        name = "base"
        module = "base"
        critical = true
        restart = {{ exits = 1, base_delay_s = 0.0, max_delay_s = 0.0 }}
    """
    with launcher(tmp_path, table, base="raise SystemExit(3)"):
        mark = tmp_path / "stopped"
        wait_until(lambda: mark.exists() and mark.read_text() == "base", timeout_s=LONG_S)


def test_check_and_dry_run_start_nothing(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text('[[node]]\nname = "a"\nmodule = "pkg.a"\n[[node]]\nname = "b"\nmodule = "pkg.a"\nafter = ["a"]\n')
    code, text = check(path, "--check")
    assert code == 2
    assert "robot.toml: [[node]] 'a': module: there is no module 'pkg.a'" in text
    (tmp_path / "pkg").mkdir()
    (tmp_path / "pkg" / "__init__.py").write_text("raise SystemExit('imported')")
    (tmp_path / "pkg" / "a.py").write_text("")
    assert check(path, "--check") == (0, f"{path}: good, 2 nodes\n")
    code, text = check(path, "--dry-run", "--log-dir", str(tmp_path))
    assert code == 0
    assert "after    a" in text
    assert "python -m metaros.cli.launch_child module pkg.a --ros-args -r __node:=b" in text


def test_wrong_commands_are_told(tmp_path: Path) -> None:
    code, text = check(tmp_path / "none.toml")
    assert (code, "none.toml: No such file" in text) == (2, True)
    path = tmp_path / "robot.toml"
    path.write_text('[[node]]\nname = "a"\ncommand = ["no-such-program"]\n')
    code, text = check(path, "--check")
    assert (code, "command: there is no program 'no-such-program'" in text) == (2, True)
    code, text = check(path, "extra")
    assert (code, "did you mean: metaros launch restart extra" in text) == (2, True)


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_a_driver_is_kept_running_like_any_node(tmp_path: Path) -> None:
    table = """
        [[node]]
        name = "computer"
        driver = "host_metrics"
        namespace = "/r"
        parameters = { rate_hz = 5.0 }
    """
    line = "host_metrics: reading this host"
    with launcher(tmp_path, table) as running:
        running.said(line)
        os.kill(running.pid("computer"), signal.SIGKILL)
        running.said(line, times=2)
        assert running.end() == 0


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ('driver = "toaster"', "driver: no driver 'toaster'; there are"),
        ('driver = "../x"', "driver: '../x' does not look like camera"),
        ('driver = "host_metrics"\nparameters = { rate_hz = 99 }', "rate_hz must be 0.01 to 10"),
        ('driver = "host_metrics"\nparameters = { rate = 1 }', "did you mean 'rate_hz'"),
    ],
)
def test_a_drivers_row_is_checked_before_anything_starts(tmp_path: Path, row: str, said: str) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(f'[[node]]\nname = "a"\n{row}\n')
    code, text = check(path, "--check")
    assert code == 2
    assert said in text
