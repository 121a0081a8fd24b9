"""A real RTSP server (GStreamer, by the system's Python) with a moving picture; it can be killed and come back."""

from __future__ import annotations

import os
import subprocess
from types import TracebackType

import pytest

__all__ = ["RtspServer"]

PYTHON = "/usr/bin/python3"
SCRIPT = """
import sys
try:
    import gi
    gi.require_version("Gst", "1.0")
    gi.require_version("GstRtspServer", "1.0")
    from gi.repository import GLib, Gst, GstRtspServer
except (ImportError, ValueError):
    sys.exit("missing")
Gst.init(None)
server = GstRtspServer.RTSPServer()
server.set_address("127.0.0.1")
server.set_service(sys.argv[1])
factory = GstRtspServer.RTSPMediaFactory()
factory.set_launch(
    "( videotestsrc is-live=true pattern=ball ! video/x-raw,width=320,height=240,framerate=50/1"
    " ! x264enc tune=zerolatency speed-preset=ultrafast key-int-max=10 ! rtph264pay name=pay0 pt=96 config-interval=1 )"
)
factory.set_shared(True)
server.get_mount_points().add_factory("/stream", factory)
if server.attach(None) == 0:
    sys.exit("no port")
print("ready", flush=True)
GLib.MainLoop().run()
"""


class RtspServer:
    """At `url`, from `start` on; CI has GStreamer, elsewhere the test is skipped where it is missing."""

    def __init__(self, port: int) -> None:
        self.port = port
        self.url = f"rtsp://127.0.0.1:{port}/stream"
        self._process: subprocess.Popen[str] | None = None

    def start(self) -> None:
        """Serve; it is ready when this returns."""
        self._process = subprocess.Popen(
            [PYTHON, "-c", SCRIPT, str(self.port)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert self._process.stdout is not None
        if self._process.stdout.readline() == "ready\n":
            return
        _, why = self._process.communicate()
        self._process = None
        assert why == "missing\n", why
        missing = pytest.fail if os.environ.get("CI") else pytest.skip
        missing("no GStreamer RTSP server (Debian: apt install python3-gi gir1.2-gst-rtsp-server-1.0)")

    def kill(self) -> None:
        """It is gone at once."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.communicate()

    def __enter__(self) -> RtspServer:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.kill()
