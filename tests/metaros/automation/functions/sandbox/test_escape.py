"""What a hostile function reaches at each level: what is promised is refused, and what is not is shown to be open."""

from __future__ import annotations

import contextlib
import errno
import os
import platform
import signal
import socket
import stat
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio

from metaros.automation.functions.zygote import Zygote
from tests.support.functions.sandboxed_worker import LEVELS, CagedError, EndedError, SandboxedWorker, here, listening
from tests.support.waiting import wait_until_async

pytestmark = [
    pytest.mark.skipif(os.name != "posix" or not Path("/proc").is_dir(), reason="Linux"),
    pytest.mark.asyncio(loop_scope="module"),
]
L1, L2, L3 = LEVELS
MIB = 1 << 20
AS_ROOT = hasattr(os, "geteuid") and os.geteuid() == 0


@pytest_asyncio.fixture(params=LEVELS, ids=lambda level: level.name, loop_scope="module")
async def sandboxed(zygote: Zygote, request: pytest.FixtureRequest, tmp_path: Path) -> AsyncIterator[SandboxedWorker]:
    if not await here(request.param):
        pytest.skip(f"{request.param.name} is not on this machine")
    async with SandboxedWorker(
        request.param, tmp_path / "one", zygote=zygote, disk_bytes=32 * MIB, processes=16
    ) as worker:
        yield worker


TRY = """
def tried(f, *a):
    try:
        return f(*a)
    except OSError as error:
        import errno
        return errno.errorcode.get(error.errno, str(error))
"""


async def test_it_is_nobody_and_can_become_nothing_else(sandboxed: SandboxedWorker) -> None:
    found = await sandboxed.ask("""
        import ctypes, os, resource
        libc = ctypes.CDLL(None, use_errno=True)
        header, data = (ctypes.c_uint * 2)(0x20080522, 0), (ctypes.c_uint * 6)()
        assert libc.capget(header, data) == 0
        result = dict(uids=os.getresuid(), gids=os.getresgid(), groups=os.getgroups(), caps=list(data),
                      no_new_privs=libc.prctl(39, 0, 0, 0, 0), core=resource.getrlimit(resource.RLIMIT_CORE),
                      seccomp=libc.prctl(21, 0, 0, 0, 0), dumpable=libc.prctl(3, 0, 0, 0, 0))
    """)
    assert 0 not in found["uids"]
    assert 0 not in found["gids"]
    assert not AS_ROOT or found["groups"] == []
    assert found["caps"] == [0] * 6
    assert (found["no_new_privs"], found["core"]) == (1, [0, 0])
    assert found["seccomp"] == (2 if sandboxed.level >= L2 else 0)
    assert found["dumpable"] == (1 if sandboxed.level >= L3 else 0)  # at L3 nobody else is there to look


async def test_nothing_of_the_gateway_is_in_its_environment_or_open(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, sandboxed: SandboxedWorker
) -> None:
    monkeypatch.setenv("GATEWAY_SECRET", "s3cret")
    (tmp_path / "secret").write_text("s3cret")
    descriptor = os.open(tmp_path / "secret", os.O_RDONLY)
    os.set_inheritable(descriptor, True)
    try:
        async with SandboxedWorker(sandboxed.level, tmp_path / "other") as other:
            found = await other.ask("""
                import os, stat
                kinds = {}
                for fd in range(1024):
                    try:
                        kinds[fd] = stat.S_IFMT(os.fstat(fd).st_mode)
                    except OSError:
                        pass
                try:
                    told = open("/proc/self/environ").read()
                except OSError:
                    told = ""
                result = dict(environ=dict(os.environ), kinds=list(kinds.values()), told=told)
            """)
    finally:
        os.close(descriptor)
    assert "s3cret" not in str(found["environ"]) + found["told"]
    assert found["environ"]["OWN"] == "mine"
    assert "VIRTUAL_ENV" not in found["environ"]
    # /dev/null; stdout, stderr and the log; the Runtime API's connection, and a pair by which curl wakes itself
    assert sorted(found["kinds"]) == sorted([stat.S_IFCHR, *[stat.S_IFIFO] * 3, *[stat.S_IFSOCK] * 3])


async def test_the_network(sandboxed: SandboxedWorker) -> None:
    with listening() as tcp, listening(socket.SOCK_DGRAM) as udp, socket.socket(socket.AF_UNIX) as unix:
        unix.bind("\0metaros-test-" + str(os.getpid()))
        unix.listen()
        found = await sandboxed.ask(
            TRY
            + """
import socket
def tcp(family, protocol=0):
    with socket.socket(family, socket.SOCK_STREAM, protocol) as s:
        s.settimeout(5)
        s.connect(("127.0.0.1", port) if family == socket.AF_INET else ("::ffff:127.0.0.1", port))
    return "open"
def udp():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.sendto(b"x", ("127.0.0.1", udp_port))
    return "open"
def unix():
    with socket.socket(socket.AF_UNIX) as s:
        s.connect(name)
    return "open"
def fast_open():
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as s:
        s.sendto(b"x", 0x20000000, ("127.0.0.1", port))
    return "open"
def serve():
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as s:
        s.listen()
    return "open"
def kind(*a):
    socket.socket(*a).close()
    return "open"
result = dict(tcp=tried(tcp, socket.AF_INET), tcp6=tried(tcp, socket.AF_INET6), mptcp=tried(tcp, socket.AF_INET, 262),
    udp=tried(udp), unix=tried(unix), fast_open=tried(fast_open), serve=tried(serve),
    netlink=tried(kind, socket.AF_NETLINK, socket.SOCK_RAW), raw=tried(kind, socket.AF_INET, socket.SOCK_RAW, 1),
    packet=tried(kind, socket.AF_PACKET, socket.SOCK_RAW), vsock=tried(kind, socket.AF_VSOCK, socket.SOCK_STREAM),
    pair=tried(lambda: [s.close() for s in socket.socketpair()] and "open"))
""",
            port=tcp.getsockname()[1],
            udp_port=udp.getsockname()[1],
            name=unix.getsockname().decode(),
        )
        assert found.pop("pair") == "open"  # asyncio stands on it
        assert found.pop("raw") in ("EPERM", "EACCES", "EPROTONOSUPPORT")
        assert found.pop("packet") != "open"
        if sandboxed.level == L1:  # the network is as open as to any user of the machine
            assert (found["tcp"], found["udp"], found["unix"], found["serve"]) == ("open",) * 4
            tcp.accept()[0].close()
            return
        refused = "ECONNREFUSED" if sandboxed.level == L3 else "EACCES"  # at L3 it is another network's loopback
        assert found.pop("tcp") == refused
        assert found.pop("tcp6") in ("ECONNREFUSED", "EACCES", "ENETUNREACH", "EADDRNOTAVAIL")
        # a server on a loopback that nobody else has is no harm
        assert found.pop("serve") == ("open" if sandboxed.level == L3 else "EPERM")
        assert found.pop("unix") == ("ECONNREFUSED" if sandboxed.level == L3 else "EACCES")
        assert found == {
            "mptcp": "EACCES",
            "udp": "EACCES",
            "fast_open": "EPERM",
            "netlink": "EAFNOSUPPORT",
            "vsock": "EAFNOSUPPORT",
        }
        for sock in (tcp, udp):
            with pytest.raises(TimeoutError):
                sock.recv(1) if sock is udp else sock.accept()


async def test_files_of_the_machine_and_the_gateway(sandboxed: SandboxedWorker, tmp_path: Path) -> None:
    data = tmp_path / "data"
    data.mkdir(mode=0o755)
    for name, mode in (("public", 0o644), ("private", 0o600)):
        (data / name).write_text("s3cret")
        (data / name).chmod(mode)
    found = await sandboxed.ask(
        TRY
        + """
import os
def write(path):
    with open(path, "w") as f:
        f.write("x")
    return "written"
code = os.environ["LAMBDA_TASK_ROOT"]
result = dict(
    public=tried(lambda: open(f"{data}/public").read()), private=tried(lambda: open(f"{data}/private").read()),
    shadow=tried(lambda: open("/etc/shadow").read()), passwd=tried(lambda: open("/etc/passwd").read()[:4]),
    home=tried(os.listdir, "/home"), root=tried(os.listdir, "/root"),
    environ=tried(lambda: open(f"/proc/{gateway}/environ").read()),
    mem=tried(lambda: open(f"/proc/{gateway}/mem").read(1)),
    own_code=tried(lambda: "handler" in open(f"{code}/app.py").read()),
    code=tried(write, f"{code}/new.py"), code_chmod=tried(os.chmod, f"{code}/app.py", 0o777),
    interpreter=tried(write, os.__file__), etc=tried(write, "/etc/new"), var=tried(write, "/var/new"),
    root_new=tried(write, "/new"),
    tmp=tried(write, os.environ["TMPDIR"] + "/new"), null=tried(write, "/dev/null"))
""",
        data=str(data),
        gateway=os.getpid(),
    )
    assert found.pop("own_code") is True
    assert (found.pop("tmp"), found.pop("null")) == ("written", "written")
    refused = {"EACCES", "EPERM", "ENOENT", "EROFS"}
    readable = {name: found.pop(name) for name in ("public", "passwd", "home")}
    if sandboxed.level == L1:  # what any user of the machine reads, it reads
        assert readable["passwd"] == "root"
    else:
        assert set(readable.values()) <= refused
    if not AS_ROOT and sandboxed.level == L1:
        for name in ("private", "environ", "code", "code_chmod"):
            found.pop(name)  # it is the gateway's own user: nothing keeps it from these
    # /root holds, where the interpreter lies in it, nothing but that
    root = found.pop("root")
    assert root in refused if isinstance(root, str) else set(root) <= {".pyenv", ".local"}
    assert {name: value for name, value in found.items() if value not in refused} == {}
    assert (data / "private").read_text() == "s3cret"


async def test_other_workers(sandboxed: SandboxedWorker, zygote: Zygote, tmp_path: Path) -> None:
    async with SandboxedWorker(sandboxed.level, tmp_path / "victim", zygote=zygote) as victim:
        await victim.ask("""
            import os
            with open(os.environ["TMPDIR"] + "/mine", "w") as f:
                f.write("s3cret")
            result = None
        """)
        found = await sandboxed.ask(
            TRY
            + """
import ctypes, os
libc = ctypes.CDLL(None, use_errno=True)
def ptrace():
    if libc.ptrace(16, victim, 0, 0) < 0:
        raise OSError(ctypes.get_errno(), "")
    return "attached"
def peek():
    piece = ctypes.create_string_buffer(8)
    vec = (ctypes.c_size_t * 2)(ctypes.addressof(piece), 8)
    if libc.process_vm_readv(victim, vec, 1, vec, 1, 0) < 0:
        raise OSError(ctypes.get_errno(), "")
    return "read"
result = dict(tmp=tried(lambda: open(f"{tmp}/mine").read()), host_tmp=tried(os.listdir, tmp),
    code=tried(os.listdir, code),
    environ=tried(lambda: open(f"/proc/{victim}/environ").read()), kill=tried(os.kill, victim, 0),
    stop=tried(os.kill, victim, 19), ptrace=tried(ptrace), peek=tried(peek))
""",
            victim=victim.launched.pid,
            tmp=str(victim.tmp_dir),
            code=str(victim.code_dir),
        )
        code = found.pop("code")
        if sandboxed.level == L1:  # code is for all users of the machine to read
            assert code == ["app.py"] or (AS_ROOT and code in ("EACCES", "ENOENT"))
        else:
            assert code in ("EACCES", "ENOENT")
        if AS_ROOT or sandboxed.level >= L2:
            assert set(found.values()) <= {"EACCES", "EPERM", "ENOENT", "ESRCH"}
            assert await victim.ask("result = 1") == 1


async def test_signals_to_whoever_is_not_its_own(sandboxed: SandboxedWorker) -> None:
    keeper = sandboxed.launched.root_pid
    found = await sandboxed.ask(
        TRY + "import os\nresult = [tried(os.kill, pid, 0) for pid in pids]",
        pids=[os.getpid(), os.getppid(), keeper] + ([1] if sandboxed.level < L3 else []),
    )
    if AS_ROOT or sandboxed.level >= L2:
        own = [0] if sandboxed.level == L1 else []  # its keeper is of the same user: that only harms itself
        assert {value for value in found if value is not None} <= {"EPERM", "ESRCH"}
        assert found.count(None) == len(own)
    if sandboxed.level == L3:  # all that it sees is its keeper, which no signal from inside ends
        await sandboxed.ask(TRY + "import os\nfor s in (15, 9, 19): tried(os.kill, 1, s)\nresult = 1")
        assert await sandboxed.ask("result = 2") == 2


FORBIDDEN = {
    "unshare": "libc.unshare(0x10000000)",
    "unshare_net": "libc.unshare(0x40000000)",
    "mount": "libc.mount(b'none', b'/tmp', b'tmpfs', 0, None)",
    "umount": "libc.umount2(b'/tmp', 2)",
    "chroot": "libc.chroot(b'/')",
    "setns": "libc.setns(0, 0)",
    "setuid": "libc.setuid(0)",
    "setuid_same": "libc.setresuid(-1, -1, -1)",
    "setgroups": "libc.setgroups(0, None)",
    "keyctl": "libc.syscall(250, 0, -3, 0, 0, 0)",
    "add_key": "libc.syscall(248, b'user', b'x', b'y', 1, -3)",
    "bpf": "libc.syscall(321, 0, 0, 0)",
    "perf_event_open": "libc.syscall(298, 0, 0, -1, -1, 0)",
    "userfaultfd": "libc.syscall(323, 0)",
    "io_uring_setup": "libc.syscall(425, 1, buffer)",
    "ptrace": "libc.ptrace(0, 0, 0, 0)",
    "process_vm_readv": "libc.process_vm_readv(1, None, 0, None, 0, 0)",
    "kcmp": "libc.syscall(312, 1, 1, 0, 0, 0)",
    "pidfd_getfd": "libc.syscall(438, 0, 0, 0)",
    "open_by_handle_at": "libc.open_by_handle_at(-100, buffer, 0)",
    "memfd_create": "libc.memfd_create(b'x', 0)",
    "shmget": "libc.shmget(0, 4096, 0o1600)",
    "personality": "libc.personality(0x40000)",
    "clone_newuser": "libc.syscall(56, 0x10000011, 0, 0, 0, 0)",
    "init_module": "libc.syscall(175, 0, 0, 0)",
    "kexec_load": "libc.syscall(246, 0, 0, 0, 0)",
    "reboot": "libc.reboot(0)",
    "sethostname": "libc.sethostname(b'x', 1)",
    "settimeofday": "libc.settimeofday(buffer, None)",
    "syslog": "libc.klogctl(2, buffer, 8)",
    "keep_alive": "libc.prctl(1, 0, 0, 0, 0)",
    "fsopen": "libc.syscall(430, b'tmpfs', 0)",
    "landlock_free": "libc.syscall(308, 0, 0)",
}
UNKNOWN = {"clone3": "libc.syscall(435, buffer, 88)", "newer": "libc.syscall(467, 0, 0)", "none": "libc.syscall(999)"}


@pytest.mark.skipif(platform.machine() != "x86_64", reason="the numbers are of x86_64")
async def test_system_calls_that_no_handler_needs(sandboxed: SandboxedWorker) -> None:
    if sandboxed.level == L1:
        found = await sandboxed.ask("import ctypes\nresult = ctypes.CDLL(None).memfd_create(b'x', 0) >= 0")
        assert found is True  # L1 has no filter
        return
    lines = [f"    {name!r}: lambda: {call}," for name, call in (FORBIDDEN | UNKNOWN).items()]
    found = await sandboxed.ask(
        "import ctypes, errno\nlibc = ctypes.CDLL(None, use_errno=True)\nbuffer = ctypes.create_string_buffer(4096)\n"
        "calls = {\n" + "\n".join(lines) + "\n}\nresult = {}\n"
        "for name, call in calls.items():\n    value = call()\n"
        "    result[name] = errno.errorcode[ctypes.get_errno()] if value < 0 else value\n"
    )
    assert found == dict.fromkeys(FORBIDDEN, "EPERM") | dict.fromkeys(UNKNOWN, "ENOSYS")


async def test_the_other_numbering_of_system_calls_ends_it(sandboxed: SandboxedWorker) -> None:
    if sandboxed.level == L1 or platform.machine() != "x86_64":
        return
    with pytest.raises(EndedError, match=str(-signal.SIGSYS)):
        await sandboxed.ask("import ctypes\nctypes.CDLL(None).syscall(0x40000000 + 39)")


async def test_memory_over_its_limit(sandboxed: SandboxedWorker) -> None:
    with pytest.raises(CagedError) as raised:
        await sandboxed.ask("result = len(bytearray(600 << 20))")
    assert raised.value.kind == "MemoryError"
    assert await sandboxed.ask("result = len(bytearray(64 << 20))") == 64 * MIB
    await sandboxed.ask("import builtins\nbuiltins.held = bytearray(b'x' * (40 << 20))\nresult = 0")
    assert sandboxed.launched.usage().memory_bytes > 40 * MIB


async def test_a_fork_bomb_and_its_end(sandboxed: SandboxedWorker, zygote: Zygote, tmp_path: Path) -> None:
    children = await sandboxed.ask("""
        import os, signal
        result = []
        try:
            while len(result) < 500:
                pid = os.fork()
                if pid == 0:
                    signal.pause()
                result.append(pid)
        except BlockingIOError:
            pass
    """)
    assert 1 <= len(children) <= 16
    if AS_ROOT or sandboxed.level == L3:  # counted for each worker alone
        async with SandboxedWorker(sandboxed.level, tmp_path / "other", zygote=zygote) as other:
            assert await other.ask("import subprocess\nresult = subprocess.run(['true']).returncode") == 0
    tree = descendants(sandboxed.launched.root_pid)
    assert len(tree) >= len(children)
    sandboxed.launched.kill()
    assert await sandboxed.launched.wait() == -signal.SIGKILL
    await wait_until_async(lambda: not any(alive(pid) for pid in tree))


def descendants(pid: int) -> list[int]:
    """All processes below one."""
    found: list[int] = []
    with contextlib.suppress(OSError):
        for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
            found += [int(child), *descendants(int(child))]
    return found


def alive(pid: int) -> bool:
    """Whether it runs still; a zombie does not."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    return False


async def test_a_process_that_leaves_its_group(sandboxed: SandboxedWorker) -> None:
    left = await sandboxed.ask("""
        import os, signal
        reader, writer = os.pipe()
        pid = os.fork()
        if pid == 0:
            try:
                os.setsid()
            except PermissionError:
                os._exit(1)
            os.write(writer, b"x")
            signal.pause()
        os.close(writer)
        result = os.read(reader, 1) == b"x"
    """)
    if sandboxed.level == L2:
        assert left is False
        return
    assert left is True
    tree = descendants(sandboxed.launched.root_pid)
    assert len(tree) == 2
    sandboxed.launched.kill()
    await sandboxed.launched.wait()
    if sandboxed.level == L3:
        await wait_until_async(lambda: not any(alive(child) for child in tree))
    else:  # L1 has nothing to find it by
        leaver = next(child for child in tree if child != sandboxed.launched.pid)
        assert alive(leaver)
        os.kill(leaver, signal.SIGKILL)


async def test_a_full_disk_is_its_own(sandboxed: SandboxedWorker) -> None:
    found = await sandboxed.ask("""
        import errno, os
        def fill(name, most):
            written = 0
            try:
                with open(os.environ["TMPDIR"] + name, "wb", buffering=0) as f:
                    while written < most:
                        written += f.write(bytes(1 << 20))
            except OSError as error:
                return written, errno.errorcode[error.errno]
            return written, ""
        result = [fill("/small", 20 << 20), fill("/big", 100 << 20)]
    """)
    assert found[0] == [20 * MIB, ""]
    # at L3 all files together are bounded; elsewhere each one, and all are watched
    assert found[1] == ([12 * MIB, "ENOSPC"] if sandboxed.level == L3 else [32 * MIB, "EFBIG"])
    if sandboxed.level < L3:
        assert sandboxed.launched.usage().disk_bytes >= 52 * MIB


async def test_many_files_and_open_ones(sandboxed: SandboxedWorker) -> None:
    found = await sandboxed.ask("""
        import errno, os
        held = []
        try:
            while len(held) < 5000:
                held.append(os.open("/dev/null", os.O_RDONLY))
        except OSError as error:
            why = errno.errorcode[error.errno]
        result = [len(held), why]
        for fd in held:
            os.close(fd)
    """)
    assert found[0] < 1024
    assert found[1] == errno.errorcode[errno.EMFILE]


async def test_what_a_function_needs_works(sandboxed: SandboxedWorker) -> None:
    found = await sandboxed.ask("""
        import asyncio, multiprocessing, ssl, subprocess, sys, tempfile, threading, uuid, zoneinfo
        async def a():
            await asyncio.sleep(0)
            return 1
        said = []
        thread = threading.Thread(target=said.append, args=(1,)); thread.start(); thread.join()
        with tempfile.NamedTemporaryFile("w+") as f:
            f.write("x")
        shell = subprocess.run(["sh", "-c", "echo $OWN"], capture_output=True, text=True).stdout
        python = subprocess.run([sys.executable, "-c", "import json; print(6 * 7)"], capture_output=True, text=True)
        secure = bool(ssl.create_default_context())
        result = [asyncio.run(a()), said, shell, python.stdout, secure, str(uuid.uuid4()) != ""]
    """)
    assert found == [1, [1], "mine\n", "42\n", True, True]
