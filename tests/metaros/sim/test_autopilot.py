"""What the autopilot makes of a lane, a scan and its patience: figures one can drive by."""

from __future__ import annotations

import numpy as np
import pytest

from metaros.sim.autopilot import Autopilot
from metaros.sim.robot import DRIVE, Body
from metaros.sim.warehouse import WAREHOUSE

NOTHING = np.empty((2, 0))


def eastward(x: float = 8.0, y: float = 4.9) -> Body:
    """On the right-hand lane of the second aisle."""
    return Body(WAREHOUSE, x=x, y=y, heading_rad=0.0, charge=0.9)


def pilot_on_its_way() -> Autopilot:
    """One that has come from the western crossing of that aisle."""
    pilot = Autopilot(WAREHOUSE, np.random.default_rng(1))
    pilot.onward = lambda nodes: 4 if 4 in nodes else nodes[0]  # the crossing in the middle of the aisle
    pilot.steer(Body(WAREHOUSE, x=2.1, y=5.4, heading_rad=0.0, charge=0.9), NOTHING, sight=1.0, now_s=0.0)
    return pilot


def wall(gap_m: float, aside_m: float = 0.0) -> np.ndarray:
    """Returns of something so far before the bumper."""
    return np.array([[gap_m + DRIVE.radius_m], [aside_m]])


def test_a_free_lane_is_driven_at_cruising_speed_and_slowly_in_poor_sight() -> None:
    pilot, body = pilot_on_its_way(), eastward()
    linear, angular = pilot.steer(body, NOTHING, sight=1.0, now_s=1.0)
    assert 0.55 <= pilot.cruise_m_s <= 0.75
    assert linear == pytest.approx(pilot.cruise_m_s)
    assert angular == pytest.approx(0.0, abs=1e-9)
    assert pilot.steer(body, NOTHING, sight=0.4, now_s=1.1)[0] == pytest.approx(0.4 * pilot.cruise_m_s)
    assert pilot.steer(body, wall(0.1, aside_m=0.4), sight=1.0, now_s=1.2)[0] == pytest.approx(pilot.cruise_m_s)


def test_it_steers_to_its_lane_and_turns_on_the_spot_where_it_must() -> None:
    pilot = pilot_on_its_way()
    left = pilot.steer(eastward(y=5.4), NOTHING, sight=1.0, now_s=1.0)[1]
    right = pilot.steer(eastward(y=4.4), NOTHING, sight=1.0, now_s=1.1)[1]
    assert left == pytest.approx(-right)
    assert left == pytest.approx(-2.4 * np.arctan2(0.5, 0.9))
    back = Body(WAREHOUSE, x=8.0, y=4.9, heading_rad=2.5, charge=0.9)
    assert pilot.steer(back, NOTHING, sight=1.0, now_s=1.2) == (0.0, -DRIVE.max_angular_rad_s)


def test_it_slows_down_before_an_obstacle_and_stands_a_third_of_a_metre_before_it() -> None:
    pilot, body = pilot_on_its_way(), eastward()
    assert pilot.steer(body, wall(0.6), sight=1.0, now_s=1.0)[0] == pytest.approx(1.1 * 0.3)
    assert pilot.steer(body, wall(0.34), sight=1.0, now_s=1.1)[0] == 0.0
    assert pilot.said == [("info", "collision avoided: obstacle 0.34 m ahead, waiting")]


def test_its_patience_ends_it_turns_back_and_where_that_does_not_help_it_creeps() -> None:
    pilot, body = pilot_on_its_way(), eastward()
    times = np.arange(1.0, 20.0, 0.1)
    waited_s: list[float] = []
    for now_s in times:
        speed, _ = pilot.steer(body, wall(0.2), sight=1.0, now_s=float(now_s))
        if any("turning back" in text for _, text in pilot.said):
            waited_s.append(float(now_s) - 1.0)
            break
        assert speed == 0.0
    assert 1.9 <= waited_s[0] <= 5.2
    assert pilot.steer(body, wall(0.2), sight=1.0, now_s=10.0) == (0.0, DRIVE.max_angular_rad_s)  # it turns round

    pilot.said.clear()
    westward = Body(WAREHOUSE, x=8.0, y=5.9, heading_rad=np.pi, charge=0.9)
    westward.x, westward.y = body.x, body.y + 0.4  # as good as where it turned back
    for now_s in times + 20.0:
        speed, _ = pilot.steer(westward, wall(0.2), sight=1.0, now_s=float(now_s))
        if pilot.said and "creeping" in pilot.said[-1][1]:
            break
    assert pilot.said[-1] == ("warn", "blocked on both sides: creeping on")
    began_s = float(now_s)
    for later_s in (0.1, 3.9):
        assert pilot.steer(westward, wall(0.2), sight=1.0, now_s=began_s + later_s)[0] == pytest.approx(0.12)
    assert pilot.steer(westward, wall(0.2), sight=1.0, now_s=began_s + 4.1)[0] == 0.0
