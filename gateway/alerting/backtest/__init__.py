"""What would have fired: the gateway's judge over stored history of a robot, with any of its checks changed."""

from __future__ import annotations

from gateway.backtest.desk import BacktestDesk
from gateway.backtest.plot import plot_svg
from gateway.backtest.report import BacktestRequest, Fired, Report, SeriesReport, Would

__all__ = ["BacktestDesk", "BacktestRequest", "Fired", "Report", "SeriesReport", "Would", "plot_svg"]
