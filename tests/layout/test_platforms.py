"""Only Linux is run here; that Windows and macOS are possible is checked by reading and by importing.

`LACKS` is what those platforms do not have. The first test reads every module and follows only the code that the
platform would run: `if sys.platform …` is evaluated, and what a `try` catches is allowed. The second imports every
module in a process where all of it was taken away.
"""

from __future__ import annotations

import ast
import functools
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.layout.reading import PACKAGES, ROOT, sources
from tests.layout.test_modules import module_names


@dataclass(frozen=True, slots=True)
class Lacks:
    """What a platform's Python does not have."""

    modules: frozenset[str]
    attributes: dict[str, frozenset[str]]
    methods: frozenset[str] = frozenset()  # there, but they raise NotImplementedError


def words(text: str) -> frozenset[str]:
    """A table's cell."""
    return frozenset(text.split())


LINUX_OS = words(
    "copy_file_range epoll eventfd eventfd_read eventfd_write fdatasync getrandom getresuid memfd_create pidfd_open "
    "posix_fadvise posix_fallocate sched_getaffinity sched_getparam sched_getscheduler sched_rr_get_interval "
    "sched_setaffinity sched_setparam sched_setscheduler sched_param setns setxattr splice unshare O_DIRECT O_PATH "
    "O_TMPFILE SCHED_BATCH SCHED_IDLE SCHED_RESET_ON_FORK"
)
LACKS = {
    "win32": Lacks(
        modules=words("crypt curses fcntl grp nis posix pty pwd readline resource spwd syslog termios tty uvloop"),
        attributes={
            "os": LINUX_OS
            | words(
                "chown chroot confstr ctermid fchdir fchmod fchown fork forkpty getegid geteuid getgid getgrouplist "
                "getgroups getloadavg getpgid getpgrp getpriority getsid getuid initgroups killpg lchown lockf mkfifo "
                "mknod nice openpty pathconf pipe2 posix_spawn pread pwrite readv register_at_fork sched_yield "
                "sendfile set_blocking setegid seteuid setgid setgroups setpgid setpriority setregid setreuid setsid "
                "setuid statvfs sync sysconf tcgetpgrp tcsetpgrp ttyname uname wait wait3 wait4 waitid writev "
                "SCHED_FIFO SCHED_OTHER SCHED_RR O_CLOEXEC O_DIRECTORY O_NOFOLLOW O_NONBLOCK O_SYNC WNOHANG"
            ),
            "signal": words(
                "SIGALRM SIGCHLD SIGCONT SIGHUP SIGKILL SIGPIPE SIGQUIT SIGRTMAX SIGRTMIN SIGSTOP SIGTSTP SIGUSR1 "
                "SIGUSR2 SIGWINCH alarm pause pthread_kill pthread_sigmask setitimer siginterrupt sigpending sigwait "
                "sigtimedwait sigwaitinfo"
            ),
            "select": words("epoll kqueue poll"),
            "socket": words("AF_NETLINK AF_PACKET AF_UNIX SO_REUSEPORT send_fds recv_fds"),
            "time": words("clock_getres clock_gettime clock_settime pthread_getcpuclockid tzset"),
        },
        methods=words("add_signal_handler add_reader add_writer create_unix_server create_unix_connection"),
    ),
    "darwin": Lacks(
        modules=words("nis spwd"),
        attributes={
            "os": LINUX_OS,
            "signal": words("SIGRTMAX SIGRTMIN SIGPWR SIGSTKFLT sigtimedwait sigwaitinfo"),
            "select": words("epoll"),
            "socket": words("AF_NETLINK AF_PACKET"),
            "time": words("CLOCK_BOOTTIME CLOCK_TAI pthread_getcpuclockid"),
        },
    ),
}
EXCUSES = {
    "modules": {"ImportError", "ModuleNotFoundError"},
    "attributes": {"AttributeError"},
    "methods": {"NotImplementedError"},
}


class Reader:
    """Follows the code that one platform runs, and notes what it would not find there."""

    def __init__(self, platform: str) -> None:
        self.platform = platform
        self.found: list[tuple[int, str]] = []

    def block(self, body: list[ast.stmt], caught: frozenset[str]) -> None:
        """Statements in order; nothing after a branch that surely leaves."""
        for statement in body:
            self.node(statement, caught)
            if isinstance(statement, ast.If) and (known := self.truth(statement.test)) is not None:
                taken = statement.body if known else statement.orelse
                if taken and isinstance(taken[-1], ast.Return | ast.Raise | ast.Continue | ast.Break):
                    return

    def node(self, node: ast.AST, caught: frozenset[str]) -> None:
        """One statement or expression, and all below it that runs."""
        if isinstance(node, ast.If | ast.IfExp):
            known = self.truth(node.test)
            branches = [node.body] if known else [node.orelse] if known is False else [node.body, node.orelse]
            for branch in branches:
                self.block(branch, caught) if isinstance(branch, list) else self.node(branch, caught)
            return
        if isinstance(node, ast.Try):
            names = {n.id for handler in node.handlers if handler.type for n in named(handler.type)}
            self.block(node.body, caught | names)
            for part in (*node.handlers, *node.orelse, *node.finalbody):
                self.node(part, caught)
            return
        if isinstance(node, ast.With):
            names = {n.id for item in node.items for n in suppressed(item.context_expr)}
            self.block(node.body, caught | names)
            for item in node.items:
                self.node(item, caught)
            return
        self.check(node, caught)
        for _, value in ast.iter_fields(node):
            if isinstance(value, list) and value and isinstance(value[0], ast.stmt):
                self.block(value, caught)
            else:
                for child in value if isinstance(value, list) else [value]:
                    if isinstance(child, ast.AST):
                        self.node(child, caught)

    def check(self, node: ast.AST, caught: frozenset[str]) -> None:
        """Note what this very node asks for in vain."""
        lacks = LACKS[self.platform]
        if isinstance(node, ast.Import):
            self.missing("modules", node, {alias.name.split(".")[0] for alias in node.names} & lacks.modules, caught)
        elif isinstance(node, ast.ImportFrom) and node.module:
            self.missing("modules", node, {node.module.split(".")[0]} & lacks.modules, caught)
            gone = {alias.name for alias in node.names} & lacks.attributes.get(node.module, frozenset())
            self.missing("attributes", node, gone, caught)
        elif isinstance(node, ast.Attribute):
            owner = node.value.id if isinstance(node.value, ast.Name) else ""
            self.missing("attributes", node, {node.attr} & lacks.attributes.get(owner, frozenset()), caught)
            self.missing("methods", node, {node.attr} & lacks.methods, caught)

    def missing(self, kind: str, node: ast.stmt | ast.expr, names: set[str], caught: frozenset[str]) -> None:
        """Note the names, unless the code is prepared for it."""
        if not caught & EXCUSES[kind]:
            self.found += [(node.lineno, name) for name in sorted(names)]

    def truth(self, test: ast.expr) -> bool | None:
        """What a test is on this platform; None where the platform does not decide it."""
        if isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not):
            return None if (known := self.truth(test.operand)) is None else not known
        if isinstance(test, ast.BoolOp):
            values = [self.truth(value) for value in test.values]
            decisive = isinstance(test.op, ast.Or)
            return decisive if decisive in values else None if None in values else not decisive
        match ast.unparse(test).split(" ", 2):
            case ["sys.platform", "==" | "!=" as operator, name]:
                return (name.strip("'") == self.platform) == (operator == "==")
            case ["os.name", "==" | "!=" as operator, name]:
                return (name.strip("'") == ("nt" if self.platform == "win32" else "posix")) == (operator == "==")
            case ["TYPE_CHECKING"]:
                return False
        return None


def named(expression: ast.expr) -> Iterator[ast.Name]:
    """The names in an except clause."""
    yield from (node for node in ast.walk(expression) if isinstance(node, ast.Name))


def suppressed(expression: ast.expr) -> Iterator[ast.Name]:
    """The exceptions of `contextlib.suppress(…)`."""
    if isinstance(expression, ast.Call) and ast.unparse(expression.func).endswith("suppress"):
        for argument in expression.args:
            yield from named(argument)


def complaints(module: ast.Module, platform: str) -> list[tuple[int, str]]:
    """Line and name of all that the code would not find on the platform."""
    reader = Reader(platform)
    reader.block(module.body, frozenset())
    return reader.found


def suspicious(text: str) -> bool:
    """Whether a module has in it what could be complained of: only such ones are read."""
    return any(pattern.search(text) for pattern in patterns())


@functools.cache
def patterns() -> list[re.Pattern[str]]:
    """One for each way to ask for what is lacking; that begin with letters, as those are fast."""
    owned: dict[str, set[str]] = {}
    for one in LACKS.values():
        for owner, names in one.attributes.items():
            owned.setdefault(owner, set()).update(names)
    modules = "|".join(sorted({name for one in LACKS.values() for name in one.modules}))
    methods = "|".join(sorted({name for one in LACKS.values() for name in one.methods}))
    forms = [rf"(?:import|from) [^#\n]*\b(?:{modules})\b", rf"\.(?:{methods})\b", rf"from (?:{'|'.join(owned)}) import"]
    forms += [rf"{owner}\s*\.\s*(?:{'|'.join(sorted(names))})\b" for owner, names in owned.items()]
    return [re.compile(form) for form in forms]


def test_nothing_is_used_that_a_platform_lacks() -> None:
    texts = {path: path.read_text() for path in sources(*PACKAGES)}
    modules = {path: ast.parse(text) for path, text in texts.items() if suspicious(text)}
    assert len(modules) > 30
    found = [
        f"{platform}: {path.relative_to(ROOT)}:{line} {name}"
        for path, module in modules.items()
        for platform in LACKS
        for line, name in complaints(module, platform)
    ]
    assert found == []


def test_the_reader_sees_what_windows_would_see() -> None:
    cases = [
        ("import fcntl", ["fcntl"]),
        ("def f():\n  from termios import tcgetattr", ["termios"]),
        ("os.killpg(1, signal.SIGKILL)", ["SIGKILL", "killpg"]),
        ("from os import fork", ["fork"]),
        ("loop.add_signal_handler(1, f)", ["add_signal_handler"]),
        ("if sys.platform == 'win32':\n  import fcntl\nelse:\n  import pwd", ["fcntl"]),
        ("if sys.platform != 'win32':\n  import fcntl", []),
        ("if sys.platform == 'win32':\n  x = 1\nelse:\n  import fcntl", []),
        ("def f():\n  if sys.platform == 'win32':\n    return\n  import fcntl", []),
        ("x = os.getuid() if sys.platform != 'win32' else 0", []),
        ("if os.name == 'posix' and y:\n  import pwd", []),
        ("try:\n  import fcntl\nexcept ImportError:\n  fcntl = None", []),
        ("try:\n  import fcntl\nexcept OSError:\n  pass", ["fcntl"]),
        ("with suppress(AttributeError):\n  os.pidfd_open(1)", []),
        ("try:\n  loop.add_signal_handler(1, f)\nexcept NotImplementedError:\n  pass", []),
    ]
    wrong = [code for code, found in cases if sorted(name for _, name in complaints(ast.parse(code), "win32")) != found]
    assert wrong == []
    assert [code for code, found in cases if found and not suspicious(code)] == []


IMPORT_ALL = """
import importlib, os, select, signal, socket, sys, time
modules, platforms = {modules!r}, {platforms!r}
for name in modules:  # brings in the libraries as they are here: they know their own platforms
    importlib.import_module(name)
owners = dict(os=os, select=select, signal=signal, socket=socket, time=time)
here, there = sys.platform, {{name: dict(vars(owner)) for name, owner in owners.items()}}
for platform, (again, lacking, attributes) in platforms.items():
    for name in again:
        sys.modules.pop(name, None)
    known = {{name: sys.modules.get(name) for name in lacking}}
    sys.modules.update(dict.fromkeys(lacking))
    for owner, names in attributes.items():
        for name in names:
            vars(owners[owner]).pop(name, None)
    sys.platform = platform  # os.name stays: pathlib reads it at each path, and would have Windows paths
    for name in again:
        try:
            importlib.import_module(name)
        except Exception as error:
            print(f"{{platform}}: {{name}}: {{type(error).__name__}}: {{error}}")
    sys.platform = here
    for owner, names in there.items():
        vars(owners[owner]).update(names)
    for name, module in known.items():
        del sys.modules[name]
        if module is not None:
            sys.modules[name] = module
"""


@pytest.mark.integration
def test_every_module_imports_where_that_is_missing() -> None:
    """All of them on Windows; on macOS, which has more of it, those whose code could ask where it is."""
    every = [*PACKAGES, *module_names()]
    again = {"win32": every, "darwin": [name for name in every if asks_for_the_system(text_of(name))]}
    code = IMPORT_ALL.format(
        modules=every,
        platforms={
            platform: (
                again[platform],
                sorted(lacks.modules),
                {owner: sorted(names) for owner, names in lacks.attributes.items()},
            )
            for platform, lacks in LACKS.items()
        },
    )
    # By stdin: it is too long for an argument.
    done = subprocess.run([sys.executable, "-"], input=code, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-4000:]
    assert done.stdout.strip() == ""


PLATFORM_TYPES = """
[mypy]
python_version = 3.11
check_untyped_defs = True
follow_imports = skip
ignore_missing_imports = True
disable_error_code = has-type, index, type-var, valid-type, var-annotated
[mypy-boto3.*,botocore.*,cv2.*,grpc.*,numpy.*,orjson.*,s3transfer.*,types_boto3_s3.*,yaml.*,zenoh.*,zmq.*]
follow_imports_for_stubs = True
"""  # what is not followed is Any, and some of these errors only say so; psutil's stubs do depend on the platform
SYSTEM = re.compile(
    r"^\s*(?:import|from) (?:ctypes|errno|faulthandler|fcntl|grp|locale|mmap|msvcrt|multiprocessing|os|pty|pwd|"
    r"resource|select|selectors|shutil|signal|socket|ssl|subprocess|termios|time|tty|winreg)\b",
    re.MULTILINE,
)
FAULTS = """
import os, signal, subprocess, sys

def fault() -> None:
    os.eventfd(0)
    signal.sigtimedwait([], 1)
    subprocess.STARTUPINFO()
    if sys.platform != "linux":
        os.gone()
"""  # each line is what one of the platforms lacks
FOUND = {"win32": {5, 6, 9}, "darwin": {5, 6, 7, 9}}


@pytest.mark.integration
@pytest.mark.parametrize("platform", LACKS)
def test_types_hold_on_the_platform(platform: str, tmp_path: Path) -> None:
    """Of the modules that ask for the system, whose types depend on it; libraries, which cost the most, are not read.

    `make check` has the rest of the types. One module has faults, and they are what is found.
    """
    (tmp_path / "types.ini").write_text(PLATFORM_TYPES)
    (tmp_path / "faults.py").write_text(FAULTS)
    modules = [path for path in sources(*PACKAGES) if asks_for_the_system(path.read_text())]
    assert len(modules) > 100
    mypy = Path(sys.executable).with_name("mypy")
    flags = ["--platform", platform, "--cache-dir", os.devnull, "--config-file", str(tmp_path / "types.ini")]
    done = subprocess.run(
        [mypy, *flags, tmp_path / "faults.py", *modules], cwd=ROOT, capture_output=True, text=True, timeout=250
    )
    errors = [line for line in done.stdout.splitlines() if ": error: " in line and "? has no attribute" not in line]
    planted = {int(line.split(":")[1]) for line in errors if "faults.py:" in line}
    assert planted == FOUND[platform], done.stdout[-4000:] + done.stderr
    assert [line for line in errors if "faults.py:" not in line] == []


def text_of(name: str) -> str:
    """A module's source."""
    path = ROOT.joinpath(*name.split("."))
    return (path / "__init__.py" if path.is_dir() else path.with_suffix(".py")).read_text()


def asks_for_the_system(text: str) -> bool:
    """Whether a module's types could depend on the platform."""
    return suspicious(text) or "sys.platform" in text or "os.name" in text or bool(SYSTEM.search(text))
