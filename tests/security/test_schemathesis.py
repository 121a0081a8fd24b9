"""The whole API, tried by schemathesis as everybody: no server error, no answer beside its schema, no open door.

Here a sample, `tests/security/test_matrix.py` asks every operation as every asker; all of it: `make campaign ARGS=api`.
"""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from gateway.domain.principal import Role
from gateway.identity.permissions import PERMISSIONS
from tests.security.test_matrix import ASKERS, EXPECTED
from tests.support.api_fuzzer import Report, fuzz_api
from tests.support.busy_gateway import busy_gateway
from tests.support.plain_http import FREE

SEED = 20_261_121
SAMPLE = {"admin": 1, "scoped": 1, "viewer": 4, "nobody": 4}  # an example of one in so many paths
# Asker: the column of the matrix, role, robots.
WHO: dict[str, tuple[str, Role, tuple[str, ...]]] = {
    "nobody": ("nobody", Role.NONE, ()),
    "anonymous": ("anonymous", Role.VIEWER, ("*",)),
    "viewer": ("viewer", Role.VIEWER, ("*",)),
    "operator": ("operator", Role.OPERATOR, ("*",)),
    "admin": ("admin", Role.ADMIN, ("*",)),
    "scoped": ("operator", Role.OPERATOR, ("sim_*",)),
}


async def tried(folder: Path, who: str, *, examples: int, phases: tuple[str, ...], one_in: int = 1) -> Report:
    """Everything, or one in so many paths, as one asker, on a gateway of their own."""
    column, role, robots = WHO[who]
    granted = {row.name for row in PERMISSIONS if EXPECTED[row.name][ASKERS.index(column)] == "+"}
    anonymous, scoped = who == "anonymous", who == "scoped"
    async with busy_gateway(folder, "sim_1", "sim_2", "hidden_1", anonymous=anonymous, **FREE) as busy:
        key = {"nobody": "", "anonymous": "", "admin": busy.admin}.get(who)
        if key is None:
            key = await busy.key(role, *robots)
        report = await asyncio.to_thread(
            fuzz_api,
            busy.ready.url,
            key=key,
            granted=granted,
            hidden="hidden_1" if scoped else "",
            seed=SEED,
            examples=examples,
            phases=phases,
            anonymous=anonymous,
            one_in=one_in,
        )
    print(f"{who}: seed {SEED}, {report.cases} cases, {len(report.reached)} operations carried out")
    return report


@pytest.mark.integration
@pytest.mark.parametrize("who", SAMPLE)
async def test_a_sample_as(tmp_path: Path, who: str) -> None:
    report = await tried(tmp_path, who, examples=1, phases=("fuzzing",), one_in=SAMPLE[who])
    assert not report.wrong, "\n".join(report.wrong[:30])
    assert report.cases >= 100 // SAMPLE[who]
    assert report.reached
