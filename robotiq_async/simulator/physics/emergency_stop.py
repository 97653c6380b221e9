"""An emergency stop: the motors have no power, and some resets are needed after it."""

from __future__ import annotations


class EmergencyStop:
    """Whether an emergency stop keeps the axes from moving.

    One person reports it, of a two-finger gripper: gFLT is 0x05 afterwards, and a reset helps only sometimes.
    """

    def __init__(self) -> None:
        self._is_pressed = False
        self._resets_needed = 0

    @property
    def is_in_force(self) -> bool:
        """Whether nothing moves because of it."""
        return self._is_pressed or self._resets_needed > 0

    def press(self, resets: int) -> None:
        """Stop; after its end so many resets are needed."""
        self._is_pressed, self._resets_needed = True, resets

    def end(self) -> None:
        """Give the motors their power back."""
        self._is_pressed = False

    def reset(self) -> None:
        """A reset, which helps only after the end."""
        if not self._is_pressed and self._resets_needed:
            self._resets_needed -= 1

    def forget(self) -> None:
        """The gripper was without power: no reset is needed any longer."""
        self._resets_needed = 0
