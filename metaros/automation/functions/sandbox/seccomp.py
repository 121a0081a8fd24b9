"""Which system calls a worker may make: a filter in the kernel, that it and its children can never take off."""

from __future__ import annotations

import ctypes
import errno
import functools
import struct

from metaros.automation.functions.sandbox.calls import AUDIT_ARCH, CALLS, LAST_KNOWN
from metaros.automation.functions.sandbox.libc import PR_SET_PDEATHSIG, machine, prctl

__all__ = ["build", "confine"]

PR_SET_SECCOMP, MODE_FILTER = 22, 2
ALLOW, ERRNO, KILL = 0x7FFF0000, 0x00050000, 0x80000000
LOAD, EQUAL, GREATER, AT_LEAST, ANY_BIT, AND, RETURN = 0x20, 0x15, 0x25, 0x35, 0x45, 0x54, 0x06
NUMBER_AT, ARCH_AT, ARGS_AT = 0, 4, 16
X32_BIT = 0x40000000  # another numbering of the same calls
NEW_NAMESPACES = 0x7E020000
MSG_FASTOPEN = 0x20000000  # connects without `connect`, past Landlock's rule for ports
UNIX, INET, INET6, STREAM, TCP = 1, 2, 10, 1, 6

# Nothing here serves a handler; each of them reaches other processes, the machine, or much of the kernel's code.
FORBIDDEN = (
    *("unshare", "setns", "mount", "umount2", "pivot_root", "chroot", "open_tree", "move_mount", "fsopen", "fsconfig"),
    *("fsmount", "fspick", "mount_setattr", "statmount", "listmount", "open_by_handle_at", "name_to_handle_at"),
    *("ptrace", "process_vm_readv", "process_vm_writev", "process_madvise", "process_mrelease", "kcmp", "pidfd_getfd"),
    *("keyctl", "add_key", "request_key", "bpf", "perf_event_open", "userfaultfd", "fanotify_init", "fanotify_mark"),
    *("io_uring_setup", "io_uring_enter", "io_uring_register", "lookup_dcookie", "nfsservctl", "uselib", "modify_ldt"),
    *("init_module", "finit_module", "delete_module", "create_module", "get_kernel_syms", "kexec_load"),
    *("kexec_file_load", "reboot", "swapon", "swapoff", "syslog", "acct", "quotactl", "quotactl_fd", "vhangup"),
    *("settimeofday", "clock_settime", "clock_adjtime", "adjtimex", "sethostname", "setdomainname", "iopl", "ioperm"),
    *("personality", "mbind", "move_pages", "migrate_pages", "set_mempolicy", "set_mempolicy_home_node"),
    *("setuid", "setgid", "setreuid", "setregid", "setresuid", "setresgid", "setgroups", "setfsuid", "setfsgid"),
    *("capset", "lsm_set_self_attr"),
    # Memory that no limit of a process counts.
    *("memfd_create", "memfd_secret", "shmget", "semget", "msgget", "mq_open"),
)
# Without a network and a pid namespace: no server, and no way out of the process group by which it is all killed.
FORBIDDEN_SHARED = ("listen", "setsid", "setpgid")

Code = list[tuple[int, int, int, int]]


def _answer(code: int) -> tuple[int, int, int, int]:
    return (RETURN, 0, 0, ERRNO | code)


def _on(call: int, body: Code) -> Code:
    """`body` where the call is this one; it returns on every path, as the loaded word is not the number any more."""
    return [(EQUAL, 0, len(body), call), *body]


def _argument(index: int) -> tuple[int, int, int, int]:
    return (LOAD, 0, 0, ARGS_AT + 8 * index)


def _socket_rule(own_network: bool) -> Code:
    """TCP, and Unix sockets only where no other process's can be reached: they lead to D-Bus, docker and the like."""
    unix = (RETURN, 0, 0, ALLOW) if own_network else _answer(errno.EACCES)
    return [
        _argument(0),
        *((EQUAL, 0, 1, UNIX), unix),
        *((EQUAL, 2, 0, INET), (EQUAL, 1, 0, INET6), _answer(errno.EAFNOSUPPORT)),
        *(_argument(1), (AND, 0, 0, 0xF), (EQUAL, 1, 0, STREAM), _answer(errno.EACCES)),
        # Landlock knows TCP; of the other streams (SCTP, MPTCP) it knows nothing
        *(_argument(2), (EQUAL, 2, 0, 0), (EQUAL, 1, 0, TCP), _answer(errno.EACCES)),
        (RETURN, 0, 0, ALLOW),
    ]


def _refuse_flag(index: int, bits: int) -> Code:
    return [_argument(index), (ANY_BIT, 0, 1, bits), _answer(errno.EPERM), (RETURN, 0, 0, ALLOW)]


@functools.cache
def build(*, own_network: bool, family: str = "") -> bytes:
    """The filter's program; `own_network`: the worker has a network and a pid namespace to itself."""
    family = family or machine()
    calls = CALLS[family]
    code: Code = [
        *((LOAD, 0, 0, ARCH_AT), (EQUAL, 1, 0, AUDIT_ARCH[family]), (RETURN, 0, 0, KILL)),
        *((LOAD, 0, 0, NUMBER_AT), (AT_LEAST, 0, 1, X32_BIT), (RETURN, 0, 0, KILL)),
        *((GREATER, 0, 1, LAST_KNOWN), _answer(errno.ENOSYS)),
        # its flags lie in memory, out of the filter's sight: without it the C library takes `clone`
        *((EQUAL, 0, 1, calls["clone3"]), _answer(errno.ENOSYS)),
    ]
    for name in (*FORBIDDEN, *(() if own_network else FORBIDDEN_SHARED)):
        if name in calls:
            code += [(EQUAL, 0, 1, calls[name]), _answer(errno.EPERM)]
    code += _on(calls["clone"], _refuse_flag(0, NEW_NAMESPACES))
    code += _on(calls["socket"], _socket_rule(own_network))
    dies_with_us = [_argument(0), (EQUAL, 0, 1, PR_SET_PDEATHSIG), _answer(errno.EPERM), (RETURN, 0, 0, ALLOW)]
    code += _on(calls["prctl"], dies_with_us)
    for name, flags in (("sendto", 3), ("sendmsg", 2), ("sendmmsg", 3)):
        code += _on(calls[name], _refuse_flag(flags, MSG_FASTOPEN))
    code.append((RETURN, 0, 0, ALLOW))
    return b"".join(struct.pack("=HBBI", *step) for step in code)


def confine(*, own_network: bool) -> None:
    """Filter this process from now on; it must have given up new privileges before."""
    program = build(own_network=own_network)
    steps = ctypes.create_string_buffer(program, len(program))
    header = ctypes.create_string_buffer(struct.pack("@HP", len(program) // 8, ctypes.addressof(steps)))
    prctl(PR_SET_SECCOMP, MODE_FILTER, ctypes.addressof(header))
