"""The whole API, tried by schemathesis as everybody: no server error, no answer beside its schema.

Here a sample: `test_matrix.py` beside this asks every operation as every asker; all of it: `make campaign ARGS=api`.
"""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from gateway.domain.principal import Role
from gateway.identity.permissions import PERMISSIONS
from tests.security.permissions.test_matrix import ASKERS, EXPECTED
from tests.support.gateways.api_fuzzer import Report, fuzz_api
from tests.support.gateways.busy_gateway import BusyGateway, busy_gateway
from tests.support.gateways.plain_http import FREE

SEED = 20_261_121
# An example of one in so many paths: answers are held against their schemas as who may have them all, once each.
SAMPLE = {"nobody": 8, "viewer": 8, "scoped": 3, "admin": 1}
SIMULATED = ("sim_1", "sim_2", "hidden_1")
# Asker: the column of the matrix, role, robots.
WHO: dict[str, tuple[str, Role, tuple[str, ...]]] = {
    "nobody": ("nobody", Role.NONE, ()),
    "anonymous": ("anonymous", Role.VIEWER, ("*",)),
    "viewer": ("viewer", Role.VIEWER, ("*",)),
    "operator": ("operator", Role.OPERATOR, ("*",)),
    "admin": ("admin", Role.ADMIN, ("*",)),
    "scoped": ("operator", Role.OPERATOR, ("sim_*",)),
}


async def tried(folder: Path, who: str, *, examples: int, phases: tuple[str, ...]) -> Report:
    """Everything as one asker, on a gateway of their own."""
    async with busy_gateway(folder, *SIMULATED, anonymous=who == "anonymous", **FREE) as busy:
        return await asked(busy, who, examples=examples, phases=phases)


async def asked(busy: BusyGateway, who: str, *, examples: int, phases: tuple[str, ...], one_in: int = 1) -> Report:
    """Everything, or one in so many paths, as one asker."""
    column, role, robots = WHO[who]
    granted = {row.name for row in PERMISSIONS if EXPECTED[row.name][ASKERS.index(column)] == "+"}
    key = {"nobody": "", "anonymous": "", "admin": busy.admin}.get(who)
    if key is None:
        key = await busy.key(role, *robots)
    report = await asyncio.to_thread(
        fuzz_api,
        busy.ready.url,
        key=key,
        granted=granted,
        hidden="hidden_1" if who == "scoped" else "",
        seed=SEED,
        examples=examples,
        phases=phases,
        anonymous=who == "anonymous",
        one_in=one_in,
    )
    print(f"{who}: seed {SEED}, {report.cases} cases, {len(report.reached)} operations carried out")
    return report


@pytest.mark.integration
async def test_a_sample_as_everybody(tmp_path: Path) -> None:
    """One gateway for them all; the admin, who takes things away, is the last."""
    wrong = []
    async with busy_gateway(tmp_path, *SIMULATED, anonymous=False, **FREE) as busy:
        for who, one_in in SAMPLE.items():
            report = await asked(busy, who, examples=1, phases=("fuzzing",), one_in=one_in)
            wrong += [f"{who}: {line}" for line in report.wrong]
            assert report.cases >= 100 // one_in, who
            assert report.reached, who
    assert not wrong, "\n".join(wrong[:30])
