"""A real PostgreSQL for tests: its own data, its own port, killed and started as a test likes.

PostgreSQL refuses to run as root, so under root it runs as `postgres` or `nobody`. The binaries are those of Debian's
package `postgresql`, or what `pg_config` names.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import asyncpg
import psutil

from gateway.store.postgres import PostgresEngine
from metaros.clock import SystemClock
from tests.support.ports import free_port
from tests.support.waiting import wait_until

__all__ = ["PostgresServer", "postgres_binaries"]

USER = "metaros"
TEMPLATE = "store"
# The rows that there are from the start, versions of the schema and counters, put aside in the template.
PUT_ASIDE = """
DO $$
DECLARE written name;
BEGIN
    CREATE SCHEMA first_rows;
    FOR written IN SELECT relname FROM pg_class
        WHERE relkind = 'r' AND relnamespace = 'public'::regnamespace AND pg_relation_size(oid) > 0
    LOOP
        EXECUTE format('CREATE TABLE first_rows.%I AS TABLE public.%I', written, written);
    END LOOP;
END $$
"""
# Nobody else is connected any more, and a database holds what it was copied with. What is small is deleted: to truncate
# a table makes new files for it and its indexes. Without triggers, foreign keys among them, rows go in any order.
EMPTY = """
DO $$
DECLARE written text; large boolean;
BEGIN
    PERFORM pg_terminate_backend(pid, 60000) FROM pg_stat_activity
        WHERE datname = current_database() AND pid <> pg_backend_pid();
    SET LOCAL session_replication_role = replica;  -- and the audit log does not let itself be emptied
    FOR written, large IN SELECT quote_ident(relname), pg_relation_size(oid) > 65536 FROM pg_class
        WHERE relkind = 'r' AND relnamespace = 'public'::regnamespace AND pg_relation_size(oid) > 0
    LOOP
        IF large THEN
            EXECUTE 'TRUNCATE public.' || written || ' CASCADE';
        ELSE
            EXECUTE 'DELETE FROM public.' || written;
        END IF;
    END LOOP;
    FOR written IN SELECT quote_ident(relname) FROM pg_class
        WHERE relkind = 'r' AND relnamespace = 'first_rows'::regnamespace
    LOOP
        EXECUTE 'INSERT INTO public.' || written || ' SELECT * FROM first_rows.' || written;
    END LOOP;
    PERFORM setval(seqrelid, seqstart, false) FROM pg_sequence;
END $$
"""
# Tables and columns, indexes, triggers, settings, and the version of the schema.
SHAPE = """
SELECT md5(string_agg(line, '|' ORDER BY line)) FROM (
    SELECT concat(c.relname, c.relkind, a.attname, a.atttypid, a.attnotnull) AS line
        FROM pg_class c JOIN pg_attribute a ON a.attrelid = c.oid WHERE c.relnamespace = 'public'::regnamespace
    UNION ALL SELECT concat(tgname, tgenabled, tgrelid::regclass) FROM pg_trigger WHERE NOT tgisinternal
    UNION ALL SELECT concat(conname, contype, conrelid::regclass) FROM pg_constraint WHERE conrelid <> 0
    UNION ALL SELECT concat('function', proname) FROM pg_proc WHERE pronamespace = 'public'::regnamespace
    UNION ALL SELECT concat('schema', nspname) FROM pg_namespace WHERE nspname NOT LIKE 'pg_%'
    UNION ALL SELECT concat('setting', s.setconfig) FROM pg_db_role_setting s
        JOIN pg_database d ON d.oid = s.setdatabase WHERE d.datname = current_database()
    UNION ALL SELECT concat('version', version) FROM metaros_schema
) AS lines
"""
# What the processes wrote the kernel has, also when they are killed; only who cuts the power would see a difference.
NOT_DURABLE = {"fsync": "off", "full_page_writes": "off", "wal_level": "minimal", "max_wal_senders": "0"}


def postgres_binaries() -> Path | None:
    """Where initdb and postgres are; None where PostgreSQL is not installed."""
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"), key=lambda path: float(path.parts[-3]))
    if found:
        return found[-1].parent
    initdb = shutil.which("initdb")
    return Path(initdb).parent if initdb else None


class PostgresServer:
    """One server; `start` after `kill` recovers what was committed. A `durable` one, for benchmarks, waits for disk."""

    def __init__(self, *options: str, durable: bool = False) -> None:
        binaries = postgres_binaries()
        if binaries is None:
            raise RuntimeError("PostgreSQL is not installed (Debian: apt install postgresql)")
        self._binaries = binaries
        self._options = options
        self._durable = durable
        self._folder = Path(tempfile.mkdtemp(prefix="mrpg"))
        self._identity = _unprivileged()
        if self._identity is not None:
            os.chown(self._folder, *self._identity)
        self._log = (self._folder / "log").open("wb")
        self._names: Iterator[int] | None = None
        self._returned: list[str] = []  # URLs of databases that nobody uses any more
        self._lent: list[str] | None = None  # those of the test that runs
        self._shape: list[asyncpg.Record] = []  # of a database with the store's tables
        self.port = free_port()
        self.process: subprocess.Popen[bytes] | None = None
        command = self._command("initdb", "-A", "trust", "-U", USER, "-E", "UTF8", "-N", "--locale=C")
        subprocess.run(command, check=True, stdout=self._log, stderr=self._log, cwd=self._folder)

    @property
    def _data(self) -> Path:
        return self._folder / "data"

    @property
    def url(self) -> str:
        """The server's default database."""
        return self._url("postgres")

    def start(self, *, timeout_s: float = 60.0) -> None:
        """Start, and wait until it answers."""
        clock = SystemClock()
        end_s = clock.monotonic_s() + timeout_s
        while True:
            self._launch()
            wait_until(lambda: self._answers() or self._ended(), timeout_s=timeout_s)
            if not self._ended():
                return
            # The killed one's children may live for a moment, and keep its shared memory.
            if clock.monotonic_s() > end_s:
                raise RuntimeError((self._folder / "log").read_text()[-2000:])

    def kill(self) -> None:
        """As a crash: all of its processes are gone at once, nothing is written any more."""
        if self.process is not None:
            self.freeze(True)  # or one that is being forked is missed; and a backend alone would go on for a while
            rest = psutil.Process(self.process.pid).children()
            self._signal(signal.SIGKILL)
            for process in rest:
                with contextlib.suppress(psutil.NoSuchProcess):
                    process.kill()
            wait_until(lambda: not any(map(_alive, rest)))

    def stop(self) -> None:
        """End it; what is open is broken off."""
        self._signal(signal.SIGINT)

    def freeze(self, on: bool) -> None:
        """Stop every process of it where it stands, or let them go on."""
        if self.process is not None:
            postmaster = psutil.Process(self.process.pid)
            for process in (postmaster, *postmaster.children()):
                with contextlib.suppress(psutil.NoSuchProcess):
                    process.suspend() if on else process.resume()

    def schema(self, *, empty: bool = False) -> str:
        """A URL to a database of its own, for one test: the store's tables are made, or (`empty`) nothing is."""
        if empty or self._lent is None:
            return self._made(empty=empty)
        self._lent.append(self._returned.pop() if self._returned else self._made())
        return self._lent[-1]

    @contextlib.contextmanager
    def lending(self) -> Iterator[None]:
        """Inside, schemas are lent: what a test leaves behind is taken out of them, and the next one has them."""
        self._lent = lent = list[str]()
        yield
        self._lent = None
        self._returned += filter(self._emptied, lent)

    def ask(self, sql: str, *values: object, url: str = "", first: str = "") -> list[asyncpg.Record]:
        """A statement as the superuser, in the default database or another, and one before it.

        On a thread, as the caller may be inside an event loop.
        """

        async def ask() -> list[asyncpg.Record]:
            connection = await asyncpg.connect(url or self.url, timeout=60, command_timeout=60)
            try:
                if first:
                    await connection.execute(first)
                return list(await connection.fetch(sql, *values))
            finally:
                await connection.close()

        with ThreadPoolExecutor(1) as thread:
            return thread.submit(lambda: asyncio.run(ask())).result()

    def close(self) -> None:
        """End it and delete its data."""
        self._signal(signal.SIGQUIT)
        self._log.close()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _url(self, database: str) -> str:
        return f"postgresql://{USER}@127.0.0.1:{self.port}/{database}"

    def _made(self, *, empty: bool = False) -> str:
        if self._names is None:
            self._names = itertools.count(1)
            self._make_template()
        name = f"test_{next(self._names)}"
        self.ask(f"CREATE DATABASE {name}" + ("" if empty else f" TEMPLATE {TEMPLATE} STRATEGY FILE_COPY"))
        return self._url(name)

    def _emptied(self, url: str) -> bool:
        """Whether a database is as it was when it was copied: all rows are gone, nothing else was changed.

        That takes a tenth of the time that a copy does, whose hundreds of files go to the disk.
        """
        try:
            return self.ask(SHAPE, first=EMPTY, url=url) == self._shape
        except (OSError, asyncpg.PostgresError):
            return False

    def _make_template(self) -> None:
        """The store's tables, made once: to make them costs 0.2 s of CPU, to copy them a fifth of that."""
        self.ask(f"CREATE DATABASE {TEMPLATE}")
        engine = PostgresEngine(self._url(TEMPLATE))
        try:
            engine.open()
            with engine.transaction(write=True):
                engine.execute("DELETE FROM meta WHERE key = 'store_id'")  # each copy draws its own
        finally:
            engine.close()
        self._shape = self.ask(SHAPE, first=PUT_ASIDE, url=self._url(TEMPLATE))

    def _launch(self) -> None:
        settings = {
            "listen_addresses": "127.0.0.1",
            "port": str(self.port),
            "unix_socket_directories": str(self._folder),
            "max_connections": "40",
            "shared_buffers": "16MB",
            **({} if self._durable else NOT_DURABLE),
        }
        pairs = [part for name, value in settings.items() for part in ("-c", f"{name}={value}")]
        self.process = subprocess.Popen(
            self._command("postgres", *pairs, *self._options),
            stdin=subprocess.DEVNULL,
            stdout=self._log,
            stderr=self._log,
            cwd=self._folder,
            start_new_session=True,
        )

    def _command(self, program: str, *options: str) -> list[str]:
        """A program of PostgreSQL's, as somebody who may run it.

        Not by `subprocess`'s own `user`: that forks, which a process with gRPC in it does not survive.
        """
        command = [str(self._binaries / program), "-D", str(self._data), *options]
        if self._identity is None:
            return command
        become = f"{_BECOME}; os.execv(sys.argv[3], sys.argv[3:])"
        return [sys.executable, "-I", "-S", "-c", become, *map(str, self._identity), *command]

    def _answers(self) -> bool:
        # Recovery refuses connections, a started server answers.
        with contextlib.suppress(OSError, asyncpg.PostgresError, TimeoutError):
            return bool(self.ask("SELECT 1"))
        return False

    def _ended(self) -> bool:
        return self.process is None or self.process.poll() is not None

    def _signal(self, number: signal.Signals) -> None:
        process, self.process = self.process, None
        if process is not None:
            process.send_signal(number)
            try:
                process.wait(timeout=60)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _alive(process: psutil.Process) -> bool:
    """Whether it still holds anything: an orphan stays a zombie until init looks, which may take seconds."""
    try:
        return bool(process.status() != psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return False


def _unprivileged() -> tuple[int, int] | None:
    """As whom to run (user, group): None for ourselves, unless that is root."""
    if sys.platform == "win32" or os.geteuid() != 0:
        return None
    import pwd

    for name in ("postgres", "nobody"):
        with contextlib.suppress(KeyError):
            entry = pwd.getpwnam(name)
            return entry.pw_uid, entry.pw_gid
    raise RuntimeError("PostgreSQL does not run as root, and there is neither a user postgres nor nobody")


_BECOME = "import os, sys; u, g = map(int, sys.argv[1:3]); os.setgroups([]); os.setgid(g); os.setuid(u)"
