"""Battery and motor models."""

from __future__ import annotations

import pytest

from metaros.sim.power import AMBIENT_C, Battery, Motor


def test_voltage_falls_with_charge_and_load() -> None:
    voltages = [Battery(charge / 10).voltage_v for charge in range(11)]
    assert voltages == sorted(voltages)
    assert voltages[0] == 20.0
    assert voltages[-1] == 28.4
    assert Battery(0.5).voltage_v == pytest.approx(25.6)
    assert Battery(0.65).voltage_v == pytest.approx(26.1)
    loaded = Battery(0.5)
    loaded.draw(250.0, dt_s=1.0)
    assert loaded.voltage_v == pytest.approx(
        Battery(0.5).voltage_v - loaded.current_a * loaded.resistance_ohm, abs=0.01
    )


def test_charge_is_ampere_hours() -> None:
    battery = Battery(1.0, capacity_ah=10.0)
    for _ in range(3600):
        battery.draw(26.0, dt_s=1.0)
    assert battery.charge == pytest.approx(0.9, abs=0.01)
    assert battery.discharged_wh == pytest.approx(26.0)


def test_a_battery_ends_at_zero() -> None:
    battery = Battery(0.001)
    battery.drain(1.0)
    battery.draw(100.0, dt_s=1.0)
    assert (battery.charge, battery.current_a) == (0.0, 0.0)


def test_a_motor_warms_up_with_work_and_cools_down() -> None:
    motor = Motor(temperature_c=AMBIENT_C)
    for _ in range(300):
        motor.run(speed_m_s=0.7, accel_m_s2=0.0, stalled=False, extra_c=0.0, dt_s=1.0)
    warm = motor.temperature_c
    assert 30.0 < warm < 55.0
    for _ in range(600):
        motor.run(speed_m_s=0.0, accel_m_s2=0.0, stalled=False, extra_c=0.0, dt_s=1.0)
    assert motor.temperature_c == pytest.approx(AMBIENT_C, abs=1.0)
    for _ in range(300):
        motor.run(speed_m_s=0.0, accel_m_s2=0.0, stalled=True, extra_c=0.0, dt_s=1.0)
    assert motor.temperature_c > 100.0
    assert motor.power_w > 200.0
