"""A network of our own between two namespaces of this machine, that can be cut, thinned, slowed and flapped.

It needs Linux, and a process inside `unshare -Urnm` (`INSIDE`): there we are root of our own networks and mounts, and
nothing outside notices. This side is one end (10.77.0.1), a holder process the other (10.77.0.2).
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import threading
from types import TracebackType

__all__ = ["HERE", "INSIDE", "THERE", "Wire", "why_not"]

INSIDE = ("unshare", "-Urnm", "--fork", "--kill-child")
HERE, THERE = "10.77.0.1", "10.77.0.2"
PATHS = f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin"  # where a plain user does not look
NEEDED = ("unshare", "nsenter", "ip", "tc", "nft")


def why_not() -> str:
    """Why this machine cannot do it, or nothing."""
    if sys.platform != "linux":
        return "network namespaces are Linux's"
    missing = [name for name in NEEDED if shutil.which(name, path=PATHS) is None]
    if missing:
        return f"not installed: {', '.join(missing)} (Debian: nftables, iproute2, util-linux)"
    tried = subprocess.run([*INSIDE, "true"], capture_output=True, text=True)
    return "" if tried.returncode == 0 else f"user namespaces are refused: {tried.stderr.strip()}"


class Wire:
    """A cable; use as a context manager, inside."""

    def __init__(self) -> None:
        command = ["unshare", "-n", "sh", "-c", "echo up; exec sleep infinity"]
        self._holder = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert self._holder.stdout is not None
        self._holder.stdout.readline()
        self.pid = self._holder.pid

    def __enter__(self) -> Wire:
        run("ip link set lo up")
        run("ip link add here type veth peer name there")
        run(f"ip link set there netns {self.pid}")
        run(f"ip addr add {HERE}/24 dev here")
        run("ip link set here up")
        self._there("ip link set lo up")
        self._there(f"ip addr add {THERE}/24 dev there")
        self._there("ip link set there up")
        run("nft add table inet fault")
        for hook in ("input", "output"):
            run(f"nft add chain inet fault {hook} {{ type filter hook {hook} priority 0 ; }}")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._holder.kill()
        self._holder.wait()
        if self._holder.stdout is not None:
            self._holder.stdout.close()

    def pull(self) -> None:
        """The cable is out: both ends see it."""
        run("ip link set here down")

    def plug(self) -> None:
        """And in again."""
        run("ip link set here up")

    def drop(self, *, towards_here: bool = True, towards_there: bool = True, percent: int = 100) -> None:
        """Packets vanish without a word, in one direction or both."""
        which = "" if percent == 100 else f"numgen random mod 100 < {percent} "
        for hook, wanted, way in (("input", towards_here, "iifname"), ("output", towards_there, "oifname")):
            if wanted:
                run(f"nft add rule inet fault {hook} {way} here {which}drop")

    def slow(self, rate: str = "1mbit") -> None:
        """So many bits a second in each direction, with a modem's queue."""
        run(f"tc qdisc add dev here root tbf rate {rate} burst 16kb latency 300ms")
        self._there(f"tc qdisc add dev there root tbf rate {rate} burst 16kb latency 300ms")

    def heal(self) -> None:
        """Everything as it was."""
        for hook in ("input", "output"):
            run(f"nft flush chain inet fault {hook}")
        for command in ("ip link set here up", "tc qdisc del dev here root"):
            run(command, check=False)
        self._there("tc qdisc del dev there root", check=False)

    def flap(self, times: int, every_s: float = 0.05) -> None:
        """Out and in, out and in."""
        pause = threading.Event()
        for _ in range(times):
            self.drop()
            pause.wait(every_s)
            self.heal()
            pause.wait(every_s)

    def _there(self, command: str, *, check: bool = True) -> None:
        run(f"nsenter -t {self.pid} -n {command}", check=check)


def run(command: str, *, check: bool = True) -> None:
    """One administrator's command."""
    done = subprocess.run(command.split(), capture_output=True, text=True, env={**os.environ, "PATH": PATHS})
    if check and done.returncode != 0:
        raise OSError(f"{command}: {done.stderr.strip()}")
