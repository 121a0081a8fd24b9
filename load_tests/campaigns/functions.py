"""Events for a function while its gateway and its workers are killed: none is lost, few run twice.

    python -m load_tests.campaigns functions [--events 10000] [--kills 20] [--seed N] [--engines sqlite,postgres]

Clients hand events to a real gateway until it has said 202 to each. All the while, at random moments, SIGKILL ends the
gateway (which is started again) or one of its workers. The function tells a counter outside of its sandbox each event
that it runs for. At the end every event has run; that some ran twice is what "at least once" means, and they may be no
more than were under way at the kills (leased by the database's own count), and those that a client sent again as it
had heard no answer.
"""

from __future__ import annotations

import argparse
import base64
import io
import tempfile
import threading
import time
import zipfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from queue import Empty, SimpleQueue
from random import Random

import httpx
import psutil

from gateway.store.engines import open_engine
from metaros.clock import system_rng
from tests.support.processes.stack import Stack
from tests.support.servers.postgres import PostgresServer
from tests.support.waiting import wait_until

__all__ = ["Figures", "main", "run"]

WORKERS = 4  # of the gateway
CLIENTS = 8
DRAIN_S = 900.0
HANDLER = """
import urllib.request

def handler(event, context):
    urllib.request.urlopen("http://127.0.0.1:%d/" + str(event["n"]), data=b"", timeout=20).close()
    return event["n"]
"""


class Counting:
    """Hears of each run; the counter of the campaign."""

    def __init__(self) -> None:
        self.runs: Counter[int] = Counter()
        self._lock = threading.Lock()
        outer = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                with outer._lock:
                    outer.runs[int(self.path.strip("/").rpartition("/")[2])] += 1
                self.send_response(204)
                self.end_headers()

            def log_message(self, *_words: object) -> None:
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.port = int(self.server.server_address[1])
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def close(self) -> None:
        """No more."""
        self.server.shutdown()
        self.server.server_close()


class Figures:
    """What was seen."""

    def __init__(self) -> None:
        self.kills: Counter[str] = Counter()
        self.again = 0  # sent again, since no answer came
        self.leased = 0  # under way when a gateway was killed
        self.lost: list[int] = []
        self.twice = 0
        self.took_s = 0.0

    @property
    def allowed(self) -> int:
        """How many may have run twice."""
        return self.again + self.leased + self.kills["worker"]

    @property
    def good(self) -> bool:
        """Whether the promise was kept."""
        return not self.lost and self.twice <= self.allowed

    def __str__(self) -> str:
        kills = ", ".join(f"{count} of a {name}" for name, count in sorted(self.kills.items()))
        return (
            f"kills: {kills}; {len(self.lost)} lost, {self.twice} run twice "
            f"(at most {self.allowed}: {self.leased} under way at kills, {self.again} sent again), {self.took_s:.0f} s"
        )


def _deploy(stack: Stack, port: int) -> None:
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w") as archive:
        archive.writestr("app.py", HANDLER % port)
    body = {
        "zip": base64.b64encode(target.getvalue()).decode(),
        "handler": "app.handler",
        "timeout_s": 30,
        "environment": {"METAROS_EGRESS": f"127.0.0.1:{port}"},
    }
    with _http(stack) as http:
        http.put("/api/v1/functions/count", json=body).raise_for_status()


@contextmanager
def _http(stack: Stack) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=stack.url, trust_env=False, timeout=30) as http:
        http.headers["Authorization"] = f"Bearer {stack.key}"
        yield http


def _send(stack: Stack, left: SimpleQueue[int], figures: Figures, over: threading.Event) -> None:
    """Hand over events until none is left, each until it is accepted."""
    while not over.is_set():
        try:
            with _http(stack) as http:
                while not over.is_set():
                    _send_one(http, left, figures)
        except Empty:
            return
        except (httpx.HTTPError, OSError):  # the gateway is down, or was started again with another key
            time.sleep(0.05)


def _send_one(http: httpx.Client, left: SimpleQueue[int], figures: Figures) -> None:
    number = left.get_nowait()
    try:
        answer = http.post("/api/v1/functions/count/invoke", params={"kind": "event"}, json={"n": number})
    except httpx.ConnectError:
        left.put(number)
        raise
    except (httpx.HTTPError, OSError):
        left.put(number)
        figures.again += 1
        raise
    if answer.status_code != 202:
        left.put(number)
        answer.raise_for_status()


def _workers(gateway: int) -> list[psutil.Process]:
    """Processes that run users' code: those that are not the gateway's user's, or of its children's children."""
    try:
        children = psutil.Process(gateway).children(recursive=True)
    except psutil.Error:
        return []
    return [child for child in children if not child.children()]


def _leased(stack: Stack, url: str) -> int:
    """How many deliveries a dead gateway had under way."""
    engine, _ = open_engine(url, stack.folder / "data")
    try:
        with engine.transaction(write=False):
            return int(engine.fetch("SELECT count(*) FROM deliveries WHERE state = 'leased'")[0][0])
    finally:
        engine.close()


def _kill(stack: Stack, rng: Random, figures: Figures, start: tuple[str, ...], url: str) -> None:
    gateway = next(item for item in reversed(stack.programs) if item.name == "gateway")
    workers = _workers(gateway.process.pid)
    if workers and rng.random() < 0.5:
        try:
            rng.choice(workers).kill()
            figures.kills["worker"] += 1
        except psutil.Error:  # it ended by itself
            pass
        return
    gateway.kill()
    figures.kills["gateway"] += 1
    figures.leased += _leased(stack, url)
    stack.gateway(*start)


def run(folder: Path, *, events: int, kills: int, seed: int, url: str = "") -> Figures:
    """One campaign on one database."""
    rng, figures, counting, over = Random(seed), Figures(), Counting(), threading.Event()
    start = ("--function-workers", str(WORKERS), "--function-egress", "any", "--requests-per-s", "0")
    start += ("--store", url) if url else ()
    left: SimpleQueue[int] = SimpleQueue()
    for number in range(events):
        left.put(number)
    began = time.monotonic()
    try:
        with Stack(folder) as stack:
            stack.gateway(*start)
            _deploy(stack, counting.port)
            clients = [threading.Thread(target=_send, args=(stack, left, figures, over)) for _ in range(CLIENTS)]
            for client in clients:
                client.start()
            try:
                _break(stack, rng, figures, counting, events, kills, start, url)
                wait_until(lambda: len(counting.runs) >= events, timeout_s=DRAIN_S, every_s=0.2)
            except AssertionError:
                pass  # what is missing is told below
            finally:
                over.set()
                for client in clients:
                    client.join()
            time.sleep(1.0)  # a run that should not be has its time to be seen
    finally:
        counting.close()
    figures.lost = [number for number in range(events) if not counting.runs[number]]
    figures.twice = sum(count - 1 for count in counting.runs.values() if count > 1)
    figures.took_s = time.monotonic() - began
    return figures


def _break(
    stack: Stack,
    rng: Random,
    figures: Figures,
    counting: Counting,
    events: int,
    kills: int,
    start: tuple[str, ...],
    url: str,
) -> None:
    """Each kill once another part of the events has run, so that all are under load."""
    for number in range(kills):
        wanted = events * (number + rng.random()) / (kills + 1)
        wait_until(lambda wanted=wanted: len(counting.runs) >= wanted, timeout_s=DRAIN_S, every_s=0.01)  # type: ignore[misc]
        before = figures.kills.total()
        while figures.kills.total() == before:
            _kill(stack, rng, figures, start, url)
        print(f"\r  kill {number + 1} of {kills}, {len(counting.runs)} of {events} have run", end="", flush=True)
    print()


def main(argv: Sequence[str] = ()) -> int:
    """Run on each database; 1 when an event was lost, or too many ran twice."""
    parser = argparse.ArgumentParser(prog="python -m load_tests.campaigns functions")
    parser.add_argument("--events", type=int, default=10_000)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int)
    parser.add_argument("--engines", default="sqlite,postgres")
    chosen = parser.parse_args(argv)
    seed = chosen.seed if chosen.seed is not None else system_rng().randrange(2**32)
    print(f"functions: {chosen.events} events, {chosen.kills} kills, seed {seed}", flush=True)
    good = True
    for engine in chosen.engines.split(","):
        server = PostgresServer(durable=True) if engine == "postgres" else None
        try:
            if server is not None:
                server.start()
            url = server.schema() if server is not None else ""
            with tempfile.TemporaryDirectory(prefix="campaign-functions-") as folder:
                found = run(Path(folder), events=chosen.events, kills=chosen.kills, seed=seed, url=url)
        finally:
            if server is not None:
                server.close()
        print(f"{'good' if found.good else 'BROKEN'}  {engine:9} {found}", flush=True)
        good = good and found.good
    return int(not good)
