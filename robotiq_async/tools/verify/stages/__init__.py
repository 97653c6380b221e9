"""The ten stages, each with what a person is told before it."""

from __future__ import annotations

from .stage import STAGES, Stage

__all__ = ["STAGES", "Stage"]
