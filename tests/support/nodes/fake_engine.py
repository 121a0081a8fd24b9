"""A program that plays a container engine: what it runs is a process of nobody's, as a real engine's containers are.

It lies in a folder as `podman`. Its images and containers are files beside it.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from tests.support.processes.processes import alive

__all__ = ["FakeEngine"]

CODE = """#!{python}
import hashlib, os, signal, subprocess, sys, time
here = {here!r}

def path(kind, name):
    return os.path.join(here, kind + "-" + name.replace(":", "-"))

def alive(pid):
    try:
        return open(f"/proc/{{pid}}/stat").read().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False

def load(_, archive):
    data = open(archive, "rb").read()
    if data.startswith(b"broken"):
        sys.exit("no image")
    digest = hashlib.sha256(data).hexdigest()
    open(path("image", digest), "wb").write(data)
    print("Loaded image: localhost/" + digest)

def image(*words):
    print("sha256:" + words[-1].removeprefix("localhost/"))

def run(*words):
    words, name = list(words), ""
    while words and words[0].startswith("-"):
        option = words.pop(0)
        value = "" if option == "--rm" else words.pop(0)
        name = value if option == "--name" else name
    digest = words.pop(0).removeprefix("sha256:")
    if os.path.exists(path("container", name)):
        sys.exit("the name is in use")
    code = open(path("image", digest)).read()
    mask = lambda how: signal.pthread_sigmask(how, [signal.SIGINT])
    mask(signal.SIG_BLOCK)  # what the child prints may be answered before this process handles it
    argv = [sys.executable, "-S", "-c", code, *words]
    child = subprocess.Popen(argv, start_new_session=True, preexec_fn=lambda: mask(signal.SIG_UNBLOCK))
    signal.signal(signal.SIGINT, lambda *_: child.send_signal(signal.SIGINT))
    mask(signal.SIG_UNBLOCK)
    open(path("container", name), "w").write(str(child.pid))
    status = child.wait()
    os.unlink(path("container", name))
    sys.exit(status if status >= 0 else 128 - status)

def rm(_, name):
    try:
        pid = int(open(path("container", name)).read())
    except OSError:
        sys.exit("no such container")
    while alive(pid):
        os.kill(pid, signal.SIGKILL)
        time.sleep(0.01)
    try:
        os.unlink(path("container", name))
    except OSError:
        pass

def rmi(digest):
    os.unlink(path("image", digest.removeprefix("sha256:")))

{{"load": load, "image": image, "run": run, "rm": rm, "rmi": rmi}}[sys.argv[1]](*sys.argv[2:])
"""


class FakeEngine:
    """In a folder for the PATH."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.program = folder / "podman"
        folder.mkdir()
        self.program.write_text(CODE.format(python=sys.executable, here=str(folder)))
        self.program.chmod(0o755)

    @property
    def path(self) -> str:
        """A PATH with it in front."""
        return f"{self.folder}{os.pathsep}{os.environ['PATH']}"

    def images(self) -> int:
        """How many it has."""
        return len(list(self.folder.glob("image-*")))

    def containers(self) -> dict[str, int]:
        """The processes of those that live, by name."""
        found: dict[str, int] = {}
        for path in self.folder.glob("container-*"):
            try:
                text = path.read_text()
            except FileNotFoundError:  # it has just gone
                continue
            if text and alive(int(text)):
                found[path.name.removeprefix("container-")] = int(text)
        return found
