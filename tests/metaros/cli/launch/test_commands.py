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

import pytest

from metaros.cli.launch import run
from tests.support.ports import free_port
from tests.support.processes.command_line import call_metaros, program, stop_metaros
from tests.support.processes.processes import alive
from tests.support.waiting import wait_until

LONG_S = 60.0
SLEEP = "import time; print('asleep'); time.sleep(3600)"
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
            if self.beats == 3:
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
        command = program("launch", str(folder / "robot.toml"), *options)
        with self.out.open("wb") as out:
            self.process = subprocess.Popen(command, stdout=out, stderr=out)

    def text(self) -> str:
        return self.out.read_text()

    def said(self, text: str, times: int = 1) -> None:
        wait_until(lambda: self.text().count(text) >= times or self._ended(text), timeout_s=LONG_S)

    def logged(self, name: str, text: str, times: int = 1) -> None:
        """In its log, where a life says it once; what the launcher says repeats the last words of who ended."""
        path = self.folder / "logs" / f"{name}.log"
        wait_until(lambda: (path.exists() and path.read_text().count(text) >= times) or self._ended(text))

    def _ended(self, text: str) -> bool:
        if self.process.poll() is not None:
            raise AssertionError(f"the launcher ended before it said {text!r}:\n{self.text()}")
        return False

    def ask(self, *words: str) -> Any:
        done = call_metaros("launch", *words, "--zenoh-port", self.port, "-o", "json")
        return json.loads(done.out) if done.code == 0 else done.err

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


def launch(path: Path, *options: str) -> tuple[int, str]:
    """One that ends by itself: its exit code, and what it says."""
    done = call_metaros("launch", str(path), *options)
    return done.code, done.out + done.err


@pytest.mark.integration
@pytest.mark.skipif(sys.platform != "linux", reason="the parent-death signal is Linux's")
def test_nodes_are_killed_hang_crash_and_are_asked_for_and_at_last_the_launcher_is_killed(tmp_path: Path) -> None:
    stop = "import os; open('stopped', 'w').write(os.environ['METAROS_NODE'])"
    again = "restart = { base_delay_s = 0.0, max_delay_s = 0.0 }"
    table = f"""
        heartbeat_s = 0.6
        safe_stop = [{json.dumps(sys.executable)}, "-S", "-c", {json.dumps(stop)}]
        [[node]]
        name = "talker"
        module = "talker"
        namespace = "/r"
        parameters = {{ word = "it's: [a] word" }}
        remap = {{ chatter = "talk" }}
        heartbeat = false
        {again}
        [[node]]
        name = "computer"
        driver = "host_metrics"
        namespace = "/r"
        parameters = {{ rate_hz = 5.0 }}
        heartbeat = false
        {again}
        [[node]]
        name = "hanger"
        class = "hanger:Hanger"
        restart = {{ base_delay_s = 3.0, max_delay_s = 3.0 }}
        [[node]]
        name = "sleeper"
        command = {json.dumps([sys.executable, "-S", "-u", "-c", SLEEP])}
        [[node]]
        name = "base"
        command = [{json.dumps(sys.executable)}, "-S", "-c", "raise SystemExit(3)"]
        critical = true
        restart = {{ exits = 1, base_delay_s = 0.0, max_delay_s = 0.0 }}
    """
    reading, talking = "host_metrics: reading this host", "/r/talker /r/talk it's: [a] word"
    with launcher(tmp_path, table, talker=TALKER, hanger=HANGER) as running:
        for name, line in (("talker", talking), ("computer", reading)):
            running.logged(name, line)
            first = running.pid(name)
            os.kill(first, signal.SIGKILL)
            running.logged(name, line, times=2)
            assert running.pid(name) != first
        assert "killed by SIGKILL" in running.text()
        running.said("hung: no heartbeat for")
        running.said("restarted, time 1")
        running.logged("hanger", "hanging now", times=2)
        mark = tmp_path / "stopped"
        wait_until(lambda: mark.exists() and mark.read_text() == "base")
        (answer,) = running.ask("stop", "sleeper")
        states = {row["name"]: row["state"] for row in answer["nodes"]}
        assert (states["sleeper"], states["computer"]) == ("stopped", "running")
        running.ask("restart", "sleeper")
        running.logged("sleeper", "asleep", times=2)
        assert "no launcher has a node 'nobody'; there are: talker, computer," in running.ask("stop", "nobody")
        assert "which node?" in running.ask("restart")
        pids = [row["pid"] for row in running.ask("status")[0]["nodes"] if row["pid"]]
        assert len(pids) >= 2
        running.process.kill()
        running.process.wait()
        wait_until(lambda: not any(alive(pid) for pid in pids))


def test_ctrl_c_ends_it_well(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(f'[[node]]\nname = "a"\ncommand = {json.dumps([sys.executable, "-S", "-u", "-c", SLEEP])}\n')
    options = ("--zenoh-port", str(free_port()), "--log-dir", str(tmp_path / "logs"))
    done = stop_metaros("launch", str(path), *options, when=lambda out: "asleep" in out)
    assert (done.code, "a" in done.out) == (0, True)


def test_exit_code_78_is_final_and_a_table_of_failures_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "REFRESH_S", 0.02)
    path = tmp_path / "robot.toml"
    path.write_text('[[node]]\nname = "wrong"\nclass = "wrong:Nobody"\n')
    (tmp_path / "wrong.py").write_text("x = 1")
    code, text = launch(path, "--zenoh-port", str(free_port()), "--log-dir", str(tmp_path / "logs"))
    assert code == 1
    assert "module wrong has no class Nobody" in text
    assert "not started again: its configuration is wrong" in text


@pytest.mark.integration
def test_eleven_crashes_are_a_quarantine_with_a_reason_until_restart_is_asked(tmp_path: Path) -> None:
    table = f"""
        [[node]]
        name = "crasher"
        command = [{json.dumps(sys.executable)}, "-S", "-c", "raise RuntimeError('no motor')"]
        restart = {{ base_delay_s = 0.0, max_delay_s = 0.0 }}
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
    with launcher(tmp_path, table, watcher=watcher) as running:
        running.said("quarantined")
        assert running.text().count("RuntimeError: no motor") >= 11
        assert "11 exits within 300 s" in running.text()
        running.said("heard /watcher started 0")
        running.said("heard crasher node_restarted 10")
        running.said("heard crasher quarantined")
        (row,) = (row for row in running.ask("status")[0]["nodes"] if row["name"] == "crasher")
        assert (row["state"], row["last_exit"]) == ("quarantined", "exit code 1")
        running.ask("restart", "crasher")
        running.said("✗ quarantined", times=2)


def test_check_and_dry_run_start_nothing(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text('[[node]]\nname = "a"\nmodule = "pkg.a"\n[[node]]\nname = "b"\nmodule = "pkg.a"\nafter = ["a"]\n')
    code, text = launch(path, "--check")
    assert code == 2
    assert "robot.toml: [[node]] 'a': module: there is no module 'pkg.a'" in text
    (tmp_path / "pkg").mkdir()
    (tmp_path / "pkg" / "__init__.py").write_text("raise SystemExit('imported')")
    (tmp_path / "pkg" / "a.py").write_text("")
    assert launch(path, "--check") == (0, f"{path}: good, 2 nodes\n")
    code, text = launch(path, "--dry-run", "--log-dir", str(tmp_path))
    assert code == 0
    assert "after    a" in text
    assert "python -m metaros.cli.launch_child module pkg.a --ros-args -r __node:=b" in text


def test_wrong_commands_are_reported(tmp_path: Path) -> None:
    code, text = launch(tmp_path / "none.toml")
    assert (code, "none.toml: No such file" in text) == (2, True)
    path = tmp_path / "robot.toml"
    path.write_text('[[node]]\nname = "a"\ncommand = ["no-such-program"]\n')
    code, text = launch(path, "--check")
    assert (code, "command: there is no program 'no-such-program'" in text) == (2, True)
    code, text = launch(path, "extra")
    assert (code, "did you mean: metaros launch restart extra" in text) == (2, True)


def test_a_drivers_row_is_checked_before_anything_starts(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    table = {
        'driver = "toaster"': "driver: no driver 'toaster'; there are",
        'driver = "../x"': "driver: '../x' does not look like camera",
        'driver = "host_metrics"\nparameters = { rate_hz = 99 }': "rate_hz must be 0.01 to 10",
        'driver = "host_metrics"\nparameters = { rate = 1 }': "did you mean 'rate_hz'",
    }
    for row, said in table.items():
        path.write_text(f'[[node]]\nname = "a"\n{row}\n')
        code, text = launch(path, "--check")
        assert (code, said in text) == (2, True), text
