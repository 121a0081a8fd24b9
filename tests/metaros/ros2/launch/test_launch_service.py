"""Launch descriptions run: in order, with scopes, processes, timers and events, to their end."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from metaros.ros2.launch import LaunchDescription, LaunchService
from metaros.ros2.launch.actions import (
    AppendEnvironmentVariable,
    DeclareLaunchArgument,
    EmitEvent,
    ExecuteProcess,
    ForEach,
    ForLoop,
    GroupAction,
    IncludeLaunchDescription,
    LogInfo,
    OpaqueCoroutine,
    OpaqueFunction,
    RegisterEventHandler,
    SetEnvironmentVariable,
    SetLaunchConfiguration,
    Shutdown,
    TimerAction,
    UnsetEnvironmentVariable,
)
from metaros.ros2.launch.conditions import IfCondition
from metaros.ros2.launch.event_handlers import (
    OnExecutionComplete,
    OnProcessExit,
    OnProcessIO,
    OnProcessStart,
    OnShutdown,
)
from metaros.ros2.launch.events.process import SignalProcess, matches_action
from metaros.ros2.launch.substitutions import (
    FindExecutable,
    LaunchConfiguration,
    LocalSubstitution,
    ThisLaunchFileDir,
)
from metaros.ros2.programs.stand_ins import ros2_file

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the programs of these tests are POSIX's")


@pytest.fixture(autouse=True)
def own_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Launches change it."""
    monkeypatch.setattr(os, "environ", os.environ.copy())
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path / "log"))


def run(*entities: Any) -> tuple[int, list[str]]:
    """The result, and the lines without those of the launch about its processes."""
    lines: list[str] = []
    service = LaunchService(out=lines.append)
    service.include_launch_description(LaunchDescription(entities))
    code = service.run()
    return code, [line for line in lines if "process " not in line]


def said(*texts: str) -> list[str]:
    return [f"[INFO] [launch.user]: {text}" for text in texts]


def test_arguments_scopes_and_conditions() -> None:
    say = LogInfo(msg=["who=", LaunchConfiguration("who")])
    inner = [SetLaunchConfiguration("who", "inner"), LogInfo(msg=["in: ", LaunchConfiguration("who")])]
    code, lines = run(
        DeclareLaunchArgument("who", default_value="world", choices=["world", "you"]),
        say,
        GroupAction(inner),
        say,
        GroupAction(inner, scoped=False, condition=IfCondition("false")),
        GroupAction([LogInfo(msg=LaunchConfiguration("who", default="gone"))], forwarding=False),
        GroupAction(inner, scoped=False),
        say,
        ForLoop("2", function=lambda i: LogInfo(msg=f"loop {i}")),
        ForEach("name:a,count:1;name:b,count:2", function=lambda name, count: LogInfo(msg=f"{name} {count + 1}")),
        OpaqueFunction(function=lambda context, text: [LogInfo(msg=text)], args=["opaque"]),
    )
    texts = ["who=world", "in: inner", "who=world", "gone", "in: inner", "who=inner"]
    assert (code, lines) == (0, said(*texts, "loop 0", "loop 1", "a 2", "b 3", "opaque"))


def test_an_argument_that_must_be_given_ends_the_launch() -> None:
    for argument, word in (
        (DeclareLaunchArgument("who", description="whom to greet"), "whom to greet"),
        (DeclareLaunchArgument("who", default_value="x", choices=["a", "b"]), "must be one of"),
    ):
        code, lines = run(argument, LogInfo(msg="not reached"))
        assert code == 1
        assert word in lines[0]


def test_processes_their_lines_their_ends_and_what_follows() -> None:
    hello = ExecuteProcess(cmd=["sh -c 'echo $WHO $LIST; exit 3'"], shell=True, name="hello", output="screen")
    missing = ExecuteProcess(cmd=["no-such-program-here"])
    heard: list[bytes] = []
    code, lines = run(
        SetEnvironmentVariable("WHO", "you"),
        SetEnvironmentVariable("LIST", "b"),
        AppendEnvironmentVariable("LIST", "c", separator="-"),
        AppendEnvironmentVariable("LIST", "a", prepend=True, separator="-"),
        UnsetEnvironmentVariable("NO_SUCH"),
        RegisterEventHandler(OnProcessStart(target_action=hello, on_start=[LogInfo(msg="started")])),
        RegisterEventHandler(OnProcessIO(target_action=hello, on_stdout=lambda event: heard.append(event.text))),
        RegisterEventHandler(
            OnProcessExit(target_action=hello, on_exit=[LogInfo(msg=["code ", LocalSubstitution("event.returncode")])])
        ),
        RegisterEventHandler(OnExecutionComplete(target_action=hello, on_completion=[LogInfo(msg="complete")])),
        hello,
        missing,
    )
    assert code == 0
    assert "[hello-1] you a-b-c" in lines
    assert heard == [b"you a-b-c\n"]
    assert [line for line in lines if "launch.user" in line] == said("started", "code 3", "complete")
    assert hello.return_code == 3
    assert missing.return_code == 127
    assert any("no-such-program-here" in line for line in lines if "launch.user" not in line)


def test_the_end_comes_by_an_action_a_signal_or_a_call_and_processes_end_with_it() -> None:
    sleep = ExecuteProcess(cmd=["sleep", "1000"])
    last = RegisterEventHandler(OnShutdown(on_shutdown=lambda event, context: [LogInfo(msg=f"end: {event.reason}")]))
    code, lines = run(last, sleep, ExecuteProcess(cmd=["true"], on_exit=Shutdown(reason="one ended")))
    assert (code, lines) == (0, said("end: one ended"))
    assert sleep.return_code == -signal.SIGINT

    by_signal = ExecuteProcess(cmd=["sleep", "1000"])
    event = SignalProcess(signal_number="SIGUSR1", process_matcher=matches_action(by_signal))
    run(RegisterEventHandler(OnProcessStart(on_start=[EmitEvent(event=event)])), by_signal)
    assert by_signal.return_code == -signal.SIGUSR1

    service = LaunchService(out=lambda line: None)
    stubborn = ExecuteProcess(
        cmd=["sh", "-c", "trap '' INT; echo ready; while true; do sleep 0.01; done"], sigterm_timeout="0.05"
    )
    call = threading.Thread(target=service.shutdown)
    start = RegisterEventHandler(OnProcessIO(on_stdout=lambda event: call.start()))
    service.include_launch_description(LaunchDescription([start, stubborn, TimerAction(period=1000.0, actions=[])]))
    assert service.run() == 0
    call.join()
    assert stubborn.return_code == -signal.SIGTERM


def test_respawn_timers_and_coroutines() -> None:
    again = ExecuteProcess(cmd=["true"], respawn=True, respawn_delay=0.001)
    starts: list[int] = []

    def count(event: Any, context: Any) -> Any:
        starts.append(event.pid)
        return Shutdown() if len(starts) == 3 else None

    run(RegisterEventHandler(OnProcessStart(target_action=again, on_start=count)), again)
    assert len(set(starts)) == 3

    async def greet(context: Any) -> None:
        context.runner.say("INFO", "launch.user", "from a coroutine")

    code, lines = run(
        OpaqueCoroutine(coroutine=greet), TimerAction(period=0.001, actions=[LogInfo(msg="later")]), LogInfo(msg="now")
    )
    assert (code, lines[0], sorted(lines[1:])) == (0, *said("now"), said("from a coroutine", "later"))


def test_a_coroutine_does_not_hold_up_the_end() -> None:
    ended = []

    async def work(context: Any) -> None:
        try:
            await asyncio.wait_for(asyncio.get_running_loop().create_future(), 10.0)
        finally:
            ended.append(True)

    code, lines = run(OpaqueCoroutine(coroutine=work), TimerAction(period=0.01, actions=[Shutdown(reason="enough")]))
    assert (code, lines, ended) == (0, [], [True])
    assert run(OpaqueCoroutine(coroutine=work), Shutdown(reason="at once")) == (0, [])


def test_files_are_included_with_arguments_and_know_where_they_are(tmp_path: Path) -> None:
    inner = tmp_path / "inner.launch.py"
    inner.write_text(
        "from metaros.ros2.launch import LaunchDescription\n"
        "from metaros.ros2.launch.actions import DeclareLaunchArgument, LogInfo\n"
        "from metaros.ros2.launch.substitutions import LaunchConfiguration, ThisLaunchFileDir\n"
        "def generate_launch_description():\n"
        "    return LaunchDescription([DeclareLaunchArgument('a', default_value='none'),\n"
        "        LogInfo(msg=[LaunchConfiguration('a'), ' ', ThisLaunchFileDir()])])\n"
    )
    code, lines = run(
        IncludeLaunchDescription(str(inner)), IncludeLaunchDescription(str(inner), launch_arguments={"a": "b"})
    )
    assert (code, lines) == (0, said(f"none {tmp_path}", f"b {tmp_path}"))
    (argument,) = LaunchDescription([IncludeLaunchDescription(str(inner))]).get_launch_arguments()
    assert argument.name == "a"
    for path, word in ((tmp_path / "no.launch.py", "no launch file"), (tmp_path / "a.launch.xml", "Python alone")):
        path.touch() if path.suffix == ".xml" else None
        assert word in run(IncludeLaunchDescription(str(path)))[1][0]
    assert "in no launch file" in run(LogInfo(msg=ThisLaunchFileDir()))[1][0]


def test_what_is_not_understood_is_said_once() -> None:
    process: dict[str, Any] = {"cmd": ["true"], "name": "p", "emulate_tty": True}
    _, lines = run(ExecuteProcess(**process), ExecuteProcess(**process))
    assert [line for line in lines if "emulate_tty" in line] == [
        "[WARNING] [launch]: not understood, and left out: p: emulate_tty"
    ]


def test_a_command_that_calls_ros2_finds_one(monkeypatch: pytest.MonkeyPatch) -> None:
    ours = ros2_file()
    monkeypatch.setenv("PATH", os.defpath)
    code, lines = run(
        ExecuteProcess(cmd=["command -v ros2"], shell=True, output="screen"),
        ExecuteProcess(cmd=["sh", "-c", "echo ${PATH##*:}"], output="screen"),
        LogInfo(msg=FindExecutable(name="ros2")),
    )
    assert code == 0
    assert sum(line.endswith(f" {ours}") for line in lines) == 2
    assert not any(line.endswith(os.path.dirname(ours)) for line in lines)
