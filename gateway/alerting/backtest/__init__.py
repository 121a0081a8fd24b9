"""What would have fired: the gateway's evaluator over stored history of a robot, with any of its checks changed."""

from __future__ import annotations

from gateway.alerting.backtest.manager import BacktestManager
from gateway.alerting.backtest.plot import plot_svg
from gateway.alerting.backtest.report import BacktestRequest, Fired, Report, SeriesReport, SimulatedAlert

__all__ = ["BacktestManager", "BacktestRequest", "Fired", "Report", "SeriesReport", "SimulatedAlert", "plot_svg"]
