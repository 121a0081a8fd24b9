"""The program that runs one function on its robot.

python -m metaros.robot_functions --package FOLDER --state FOLDER --namespace /arm_1
"""

from __future__ import annotations

import argparse
import asyncio
import logging
import os
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Final

from metaros.automation.functions.calls import FunctionSpec
from metaros.automation.functions.engine import Engine
from metaros.automation.functions.package import check_zip, unpack
from metaros.automation.functions.sandbox.level import Level
from metaros.automation.robot.actions import ActionExecutor, read_actions
from metaros.automation.robot.backlog import Backlog
from metaros.automation.robot.listener import Listener
from metaros.automation.robot.manifest import RobotFunction, read_function
from metaros.automation.robot.policy import FOLDER_VARIABLE, ROBOT_VARIABLE, FunctionPolicy
from metaros.automation.robot.results import Results
from metaros.automation.robot.runner import Runner
from metaros.clock import Clock, SystemClock, system_rng
from metaros.concurrency.file_lock import take_lock
from metaros.concurrency.signals import on_stop
from metaros.errors import ConfigError, MetarosError
from metaros.executor import SingleThreadedExecutor
from metaros.node import Context, Node
from metaros.node.arguments import without_ros_args

__all__ = ["Package", "bundled", "main", "open_package", "run_function"]

LOG = logging.getLogger("metaros.robot_functions")
BUNDLED: Final = "files/function.zip"  # where a bundle has the package; a node's folder is that of its bundle


class Package:
    """A function's code on the disk, and what it says of itself. `version` names its very bytes."""

    def __init__(self, folder: Path, version: str) -> None:
        """Raises ConfigError."""
        self.folder, self.version = folder, version
        self.function: RobotFunction = read_function(folder)

    def spec(self) -> FunctionSpec:
        """As the engine runs it."""
        function = self.function
        return FunctionSpec(
            key=f"{function.name}:{self.version}",
            name=function.name,
            version=self.version,
            arn=f"arn:aws:lambda:local:000000000000:function:{function.name}",
            handler=function.handler,
            code_dir=self.folder,
            runtime=f"python{sys.version_info.major}.{sys.version_info.minor}",
            environment=dict(function.environment),
            timeout_s=function.timeout_s,
            memory_mb=function.memory_mb,
            max_workers=function.concurrency,
        )


def open_package(path: Path, state: Path, *, version: str = "") -> Package:
    """A folder as it is, or a zip file, unpacked below `state`. Raises ConfigError, PackageError."""
    if path.is_dir():
        return Package(path.resolve(), version or "$LATEST")
    if not path.is_file():
        raise ConfigError(f"{path}: there is no such folder or zip file")
    facts = check_zip(path)
    return Package(unpack(path, state / "code"), version or facts.sha256[:12])


async def run_function(
    package: Package,
    state: Path,
    *,
    node: Node,
    robot: str,
    policy: FunctionPolicy,
    clock: Clock,
    stop: asyncio.Event,
    level: Level | None = None,
) -> None:
    """Run it until `stop`; the node is spun by the caller. Raises SandboxError, LaunchError, ConfigError."""
    loop, function = asyncio.get_running_loop(), package.function
    with ExitStack() as stack:
        backlog = Backlog(state / "backlog.sqlite3")
        stack.callback(backlog.close)
        engine = Engine(state / "engine", clock=clock, level=level, most_workers=function.concurrency)
        await engine.start()
        try:
            executor, results = ActionExecutor(node), Results(node, backlog, clock=clock)
            runner = Runner(
                function,
                package.spec(),
                backlog,
                engine.invoke,
                read=lambda returned: read_actions(returned, policy, node.resolve),
                do=executor.do,
                robot=robot,
                clock=clock,
                rng=system_rng(),
                settled=results.wake,
            )
            listener = Listener(
                node,
                function.triggers,
                backlog,
                robot=robot,
                clock=clock,
                kept=lambda: loop.call_soon_threadsafe(runner.wake),
            )
            listener.start()
            LOG.info("%s %s runs at %s", function.name, package.version, engine.status().level.name)
            try:
                await _until(stop, runner.run(), results.run())
            finally:
                await asyncio.to_thread(listener.close)
        finally:
            await engine.close()


async def _until(stop: asyncio.Event, *parts: object) -> None:
    """Run the parts until `stop`, or until one of them ends in an error."""
    tasks = [asyncio.ensure_future(part) for part in (*parts, stop.wait())]  # type: ignore[call-overload]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in done:
            task.result()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """The program; 0 where it was asked to end, 1 where it could not run."""
    options = _parser().parse_args(without_ros_args(sys.argv[1:] if arguments is None else list(arguments)))
    return _main(options.package, options.state, options, os.environ)


def bundled() -> int:
    """The entry of a signed bundle, in whose folder it is started. It takes no options: they could be set remotely."""
    environ = os.environ
    folder = environ.get(FOLDER_VARIABLE, "")
    state = Path(folder) / Path.cwd().parent.name if folder else None
    options = _parser().parse_args(["--package", BUNDLED])
    options.version = Path.cwd().name
    return _main(options.package, state, options, environ)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m metaros.robot_functions", allow_abbrev=False)
    parser.add_argument("--package", type=Path, required=True, help="the function's folder or zip file")
    parser.add_argument("--state", type=Path, help="where events wait; default ~/.metaros/functions/NAME")
    parser.add_argument("--robot", default="", help="the robot's id; default METAROS_ROBOT, else the namespace")
    parser.add_argument("--namespace", default="/", help="the robot's namespace, where no --ros-args name one")
    parser.add_argument("--level", choices=[level.name for level in Level], help="the sandbox; default the best here")
    parser.add_argument("--version", default="", help=argparse.SUPPRESS)
    return parser


def _main(path: Path, state: Path | None, options: argparse.Namespace, environ: Mapping[str, str]) -> int:
    logging.basicConfig(level=logging.INFO, format="%(message)s", stream=sys.stderr)
    try:
        place = state or Path.home() / ".metaros" / "functions" / path.resolve().stem
        place.mkdir(parents=True, exist_ok=True)
        with (place / "lock").open("a") as lock:
            if not take_lock(lock.fileno()):
                raise ConfigError(f"{place} is in use by another process")
            package = open_package(path, place, version=options.version)
            _spin(package, place, options, environ)
    except (MetarosError, OSError) as error:
        sys.stderr.write(f"{path}: {error}\n")
        return 1
    return 0


def _spin(package: Package, state: Path, options: argparse.Namespace, environ: Mapping[str, str]) -> None:
    """The node on a thread of its own, all else on this one's event loop."""
    name = package.function.name.replace("-", "_")
    with Context() as context:
        node = Node(name if name[0].isalpha() else f"f_{name}", namespace=options.namespace, context=context)
        robot = options.robot or environ.get(ROBOT_VARIABLE) or node.namespace.strip("/").replace("/", "_") or "robot"
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        thread = threading.Thread(target=executor.spin, name="functions-node")
        thread.start()
        try:
            policy = FunctionPolicy.of(environ, namespace=node.namespace)
            level = Level[options.level] if options.level else None
            asyncio.run(_run(package, state, node, robot, policy, level))
        finally:
            executor.shutdown()
            thread.join()


async def _run(
    package: Package, state: Path, node: Node, robot: str, policy: FunctionPolicy, level: Level | None
) -> None:
    stop = asyncio.Event()
    on_stop(asyncio.get_running_loop(), stop.set, hangup=True)
    clock = SystemClock()
    await run_function(package, state, node=node, robot=robot, policy=policy, clock=clock, stop=stop, level=level)
