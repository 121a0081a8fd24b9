"""The checks that a robot gets out of the box: every row can be changed or switched off by its id.

Series are named as the agent names them: the topic below the robot's namespace, then the field. Drivers name the same
thing differently, so that some rows match by the last word alone. ROS gives a battery's charge as a part, 0 to 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from gateway.alerting.anomaly.checks import Check
from metaros.idl.globs import Glob

__all__ = ["DEFAULT_CHECKS", "LEARNING", "Learning", "learning_of"]


@dataclass(frozen=True)
class Learning:
    """How a series' values are learnt: changes below `least` are none, and some series have no usual value at all."""

    series: str
    least: float = 0.0
    learnt: bool = True

    @cached_property
    def glob(self) -> Glob:
        """The series' pattern."""
        return Glob(self.series, separator=".")


# The first row that matches; every other series is learnt as it is. Positions, traffic, and what fills up have no
# usual value: for them there are thresholds.
LEARNING: tuple[Learning, ...] = (
    Learning("**.host.network.*", learnt=False),
    Learning("**.host.disk.*", learnt=False),
    Learning("**.host.memory.*", learnt=False),
    Learning("**.pose.pose.position.*", learnt=False),
    Learning("**.battery_state.temperature", least=3.0),
    Learning("**.temperature", least=2.0),
    Learning("**.celsius", least=5.0),
    Learning("**.host.cpu.percent", least=15.0),
    Learning("**.host.cpu.load_1m", least=1.0),
    Learning("**.battery_state.percentage", least=0.2),
)


def learning_of(series: str) -> Learning:
    """The row for a series."""
    return next((row for row in LEARNING if row.glob.matches(series)), Learning("**"))


DEFAULT_CHECKS: tuple[Check, ...] = (
    # --- the robot itself: facts that are no metric ---
    Check(
        id="offline",
        title="Robot is offline",
        kind="fact",
        cause="offline",
        unit="s",
        for_s=30.0,
        clear_s=5.0,
        severity="error",
    ),
    Check(
        id="behind",
        title="Robot's rows are late",
        kind="fact",
        cause="late",
        unit="s",
        high=60.0,
        for_s=30.0,
        clear_s=30.0,
    ),
    Check(
        id="ahead",
        title="Robot's clock is ahead",
        kind="fact",
        cause="clock",
        unit="s",
        high=30.0,
        for_s=30.0,
        clear_s=30.0,
    ),
    Check(
        id="link_flaps",
        title="Link comes and goes",
        kind="fact",
        cause="link",
        unit="times",
        high=5.0,
        window_s=600.0,
        clear_s=600.0,
    ),
    Check(
        id="sequence",
        title="Samples were lost",
        kind="fact",
        cause="sequence",
        unit="samples",
        high=1.0,
        window_s=300.0,
        clear_s=300.0,
    ),
    Check(
        id="crash_loop",
        title="Node crashes again and again",
        kind="fact",
        cause="crash",
        unit="times",
        high=3.0,
        window_s=600.0,
        clear_s=600.0,
        severity="error",
    ),
    # --- topics: low and high are factors of the rate that was learnt ---
    Check(id="silence", title="Topic fell silent", kind="silence", cause="silence", unit="s", clear_s=0.0),
    Check(
        id="rate_low", title="Topic is slower than usual", kind="rate", cause="rate", unit="× usual", low=0.5, for_s=2.0
    ),
    Check(
        id="rate_high",
        title="Topic is faster than usual",
        kind="rate",
        cause="rate",
        unit="× usual",
        high=2.0,
        for_s=2.0,
    ),
    Check(id="frozen", title="Value froze", kind="frozen", cause="frozen", unit="s", clear_s=0.0),
    # --- the computer ---
    Check(
        id="cpu",
        title="CPU is busy",
        kind="threshold",
        series="**.host.cpu.percent",
        cause="host",
        unit="%",
        high=95.0,
        hysteresis=10.0,
        for_s=300.0,
        clear_s=60.0,
    ),
    Check(
        id="memory",
        title="Memory is nearly full",
        kind="threshold",
        series="**.host.memory.percent",
        cause="host",
        unit="%",
        high=95.0,
        hysteresis=3.0,
        for_s=120.0,
        clear_s=60.0,
    ),
    Check(
        id="disk",
        title="Disk is nearly full",
        kind="threshold",
        series="**.host.disk.percent",
        cause="disk",
        unit="%",
        high=95.0,
        hysteresis=2.0,
        for_s=60.0,
        clear_s=60.0,
    ),
    Check(
        id="host_heat",
        title="Computer is hot",
        kind="threshold",
        series="**.host.temperature.celsius",
        cause="heat",
        unit="°C",
        high=85.0,
        hysteresis=5.0,
        for_s=30.0,
        clear_s=60.0,
    ),
    Check(
        id="host_heat_severe",
        title="Computer is about to throttle",
        kind="threshold",
        series="**.host.temperature.celsius",
        cause="heat",
        unit="°C",
        high=95.0,
        hysteresis=5.0,
        for_s=10.0,
        clear_s=60.0,
        severity="error",
    ),
    # --- battery ---
    Check(
        id="battery_low",
        title="Battery is low",
        kind="threshold",
        series="**.battery_state.percentage",
        cause="battery",
        low=0.20,
        hysteresis=0.03,
        for_s=10.0,
        clear_s=30.0,
    ),
    Check(
        id="battery_empty",
        title="Battery is nearly empty",
        kind="threshold",
        series="**.battery_state.percentage",
        cause="battery",
        low=0.10,
        hysteresis=0.03,
        for_s=5.0,
        clear_s=30.0,
        severity="error",
    ),
    Check(
        id="battery_sag",
        title="Battery voltage falls fast",
        kind="change",
        series="**.battery_state.voltage",
        cause="battery",
        unit="V/s",
        low=-0.04,
        hysteresis=0.03,
        window_s=15.0,
        for_s=4.0,
        clear_s=30.0,
    ),
    Check(
        id="battery_drain",
        title="Charge falls fast",
        kind="change",
        series="**.battery_state.percentage",
        cause="battery",
        unit="1/s",
        low=-0.001,
        hysteresis=0.0005,
        window_s=60.0,
        for_s=10.0,
        clear_s=60.0,
    ),
    Check(
        id="battery_heat",
        title="Battery is hot",
        kind="threshold",
        series="**.battery_state.temperature",
        cause="heat",
        unit="°C",
        high=55.0,
        hysteresis=5.0,
        for_s=30.0,
        clear_s=60.0,
        severity="error",
    ),
    Check(
        id="battery_cold",
        title="Battery is below freezing",
        kind="threshold",
        series="**.battery_state.temperature",
        cause="battery",
        unit="°C",
        low=0.0,
        hysteresis=2.0,
        for_s=60.0,
        clear_s=60.0,
    ),
    # --- motors ---
    Check(
        id="motor_hot",
        title="Motor is hot",
        kind="threshold",
        series="**.*motor*.temperature",
        cause="heat",
        unit="°C",
        high=80.0,
        hysteresis=5.0,
        for_s=5.0,
        clear_s=30.0,
    ),
    Check(
        id="motor_overheats",
        title="Motor overheats",
        kind="threshold",
        series="**.*motor*.temperature",
        cause="heat",
        unit="°C",
        high=95.0,
        hysteresis=5.0,
        for_s=2.0,
        clear_s=30.0,
        severity="error",
    ),
    Check(
        id="motor_rise",
        title="Motor heats up fast",
        kind="change",
        series="**.*motor*.temperature",
        cause="heat",
        unit="°C/s",
        high=0.6,
        hysteresis=0.3,
        window_s=15.0,
        for_s=5.0,
        clear_s=30.0,
    ),
    # --- what is learnt: switches, severities and causes of the detectors ---
    Check(
        id="novelty", title="Value never seen before", kind="detector", cause="change", severity="info", clear_s=60.0
    ),
    Check(id="level", title="Level changed", kind="detector", cause="change"),
    Check(id="step", title="Value jumped", kind="detector", cause="change"),
    Check(id="drift", title="Value drifts", kind="detector", cause="change"),
    Check(id="vibration", title="Value shakes more than usual", kind="detector", cause="vibration"),
    Check(id="calm", title="Value moves less than usual", kind="detector", cause="change", severity="info"),
    Check(
        id="frequency", title="Value swings at another frequency", kind="detector", cause="vibration", severity="info"
    ),
    Check(id="together", title="Metrics do not fit together", kind="detector", cause="together"),
    Check(id="cohort", title="Other than robots like it", kind="detector", cause="cohort"),
)
