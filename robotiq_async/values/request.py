"""Request: the full image of eight registers that goes to the gripper.

Every write carries all eight: a partial write of register 0 alone could change the control mode.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from . import registers as reg
from .enums import AXES, Finger, Mode


@dataclass(frozen=True, slots=True)
class AxisRequest:
    """What one axis is asked to do.

    Attributes:
        position: target in counts, 0 open .. 255 closed.
        speed: 0 slowest .. 255 fastest.
        force: 0 weakest .. 255 strongest.
    """

    position: int = 0
    speed: int = 0
    force: int = 0


_REST = (AxisRequest(),) * len(AXES)


@dataclass(frozen=True, slots=True)
class Request:
    """One image of the request block.

    Attributes:
        activate: rACT.
        go: rGTO.
        release: rATR.
        mode: rMOD; kept as found, for it is ignored while the scissor has its own registers.
        individual_fingers: rICF.
        individual_scissor: rICS.
        axes: what A, B, C and the scissor are asked, in this order.
    """

    activate: bool = False
    go: bool = False
    release: bool = False
    mode: Mode = Mode.BASIC
    individual_fingers: bool = True
    individual_scissor: bool = True
    axes: tuple[AxisRequest, ...] = _REST

    @property
    def registers(self) -> reg.Registers:
        """The eight registers.

        Raises:
            ValueError: a position, speed or force does not fit into a byte.
        """
        block = [0] * reg.REGISTER_COUNT
        reg.rACT.write(block, self.activate)
        reg.rMOD.write(block, self.mode)
        reg.rGTO.write(block, self.go)
        reg.rATR.write(block, self.release)
        reg.rICF.write(block, self.individual_fingers)
        reg.rICS.write(block, self.individual_scissor)
        for index, axis in enumerate(self.axes):
            reg.rPR[index].write(block, axis.position)
            reg.rSP[index].write(block, axis.speed)
            reg.rFR[index].write(block, axis.force)
        return tuple(block)

    @classmethod
    def from_registers(cls, registers: Sequence[int]) -> Request:
        """The image in a block of eight registers.

        Raises:
            TypeError: a register is not an int.
            ValueError: not eight registers, or one outside 0..65535.
        """
        block = reg.check_registers(registers)
        return cls(
            activate=bool(reg.rACT.read(block)),
            go=bool(reg.rGTO.read(block)),
            release=bool(reg.rATR.read(block)),
            mode=Mode(reg.rMOD.read(block)),
            individual_fingers=bool(reg.rICF.read(block)),
            individual_scissor=bool(reg.rICS.read(block)),
            axes=tuple(
                AxisRequest(reg.rPR[n].read(block), reg.rSP[n].read(block), reg.rFR[n].read(block))
                for n in range(len(AXES))
            ),
        )

    @property
    def echo(self) -> reg.Echo:
        """What a status of a gripper that follows this image repeats of it: rACT, rGTO and the positions.

        Speed and force have no echo. rMOD is left out: it means nothing while the scissor has its own
        registers.
        """
        a, b, c, s = (axis.position for axis in self.axes)
        return self.activate, self.go, a, b, c, s

    def position(self, axis: Finger) -> int:
        """The position request of one axis."""
        return self.axes[AXES.index(axis)].position

    def with_positions(self, positions: Mapping[Finger, int]) -> Request:
        """The same image with other position requests for some axes."""
        return replace(
            self,
            axes=tuple(
                replace(request, position=positions.get(axis, request.position))
                for axis, request in zip(AXES, self.axes, strict=True)
            ),
        )
