"""The Modbus functions that the simulated gripper serves, by their codes."""

from __future__ import annotations

from typing import Final

READ_HOLDING: Final = 3
READ_INPUT: Final = 4
WRITE_SINGLE: Final = 6
WRITE_MULTIPLE: Final = 16
READ_WRITE: Final = 23
TCP_FUNCTIONS: Final = frozenset({READ_HOLDING, READ_INPUT, WRITE_SINGLE, WRITE_MULTIPLE})
"""The Modbus functions that are served over TCP."""
RTU_FUNCTIONS: Final = TCP_FUNCTIONS | {READ_WRITE}
"""The functions on a serial line. The manual has 23 there, as an example (2014, p. 64; 2018, p. 46)."""
