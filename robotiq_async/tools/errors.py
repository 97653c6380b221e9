"""Errors of tools around a hand. They leave the hand running."""

from __future__ import annotations

from ..values import RobotiqError


class RecordingError(RobotiqError):
    """A recording could not be written or read."""


class ViewerError(RobotiqError):
    """A viewer could not be served."""


class MeasuringError(RobotiqError):
    """A measurement failed, or measured something else."""
