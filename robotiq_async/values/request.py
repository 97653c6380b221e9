"""Request: the full image of eight registers that goes to the gripper.

Every write carries all eight: a partial write of register 0 alone could change the control mode.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from . import registers as reg
from .enums import Finger, Mode
from .model import THREE_FINGER, Model, index_of


@dataclass(frozen=True, slots=True)
class AxisRequest:
    """The request for one axis.

    Attributes:
        position: target in counts, 0 open .. 255 closed.
        speed: 0 slowest .. 255 fastest.
        force: 0 weakest .. 255 strongest.
    """

    position: int = 0
    speed: int = 0
    force: int = 0


@dataclass(frozen=True, slots=True)
class Request:
    """One image of the request block.

    Attributes:
        activate: rACT.
        go: rGTO.
        release: rATR.
        release_opens: rARD: the direction of a release. A 3-Finger always opens.
        mode: rMOD; kept as found, for it is ignored while the scissor has its own registers.
        individual_fingers: rICF.
        individual_scissor: rICS.
        axes: the request for each axis, in the order of the model's axes; by default all zeros.
        model: of the gripper. One without modes has neither the mode nor the two bits of individual control.
    """

    activate: bool = False
    go: bool = False
    release: bool = False
    mode: Mode = Mode.BASIC
    individual_fingers: bool = True
    individual_scissor: bool = True
    axes: tuple[AxisRequest, ...] = ()
    model: Model = THREE_FINGER
    release_opens: bool = True

    def __post_init__(self) -> None:
        if not self.axes:
            object.__setattr__(self, "axes", (AxisRequest(),) * len(self.model.axes))

    @property
    def registers(self) -> reg.Registers:
        """The eight registers."""
        block = [0] * reg.REGISTER_COUNT
        reg.rACT.write(block, self.activate)
        reg.rGTO.write(block, self.go)
        reg.rATR.write(block, self.release)
        if self.model.has_modes:
            reg.rMOD.write(block, self.mode)
            reg.rICF.write(block, self.individual_fingers)
            reg.rICS.write(block, self.individual_scissor)
        else:
            reg.rARD.write(block, self.release and self.release_opens)
        for index, axis in enumerate(self.axes):
            reg.rPR[index].write(block, axis.position)
            reg.rSP[index].write(block, axis.speed)
            reg.rFR[index].write(block, axis.force)
        return tuple(block)

    @classmethod
    def from_registers(cls, registers: Sequence[int], model: Model = THREE_FINGER) -> Request:
        """The image in a block of eight registers."""
        block = reg.check_registers(registers)
        return cls(
            activate=bool(reg.rACT.read(block)),
            go=bool(reg.rGTO.read(block)),
            release=bool(reg.rATR.read(block)),
            mode=Mode(reg.rMOD.read(block)) if model.has_modes else Mode.BASIC,
            individual_fingers=bool(reg.rICF.read(block)) or not model.has_modes,
            individual_scissor=bool(reg.rICS.read(block)) or not model.has_modes,
            axes=tuple(
                AxisRequest(reg.rPR[n].read(block), reg.rSP[n].read(block), reg.rFR[n].read(block))
                for n in range(len(model.axes))
            ),
            model=model,
            release_opens=model.has_modes or bool(reg.rARD.read(block)) or not reg.rATR.read(block),
        )

    @property
    def echo(self) -> reg.Echo:
        """The echo in the status of a gripper that follows this image: rACT, rGTO and the positions.

        Speed and force have no echo. rMOD is left out: it means nothing while the scissor has its own
        registers.
        """
        return self.activate, self.go, *(axis.position for axis in self.axes)

    @property
    def by_axis(self) -> Iterable[tuple[Finger, AxisRequest]]:
        """Each axis with its request."""
        return zip(self.model.axes, self.axes, strict=True)

    def position(self, axis: Finger) -> int:
        """The position request of one axis."""
        return self.axes[index_of(self.model, axis)].position

    def with_positions(self, positions: Mapping[Finger, int]) -> Request:
        """The same image with other position requests for some axes."""
        return replace(
            self,
            axes=tuple(
                replace(request, position=positions.get(axis, request.position))
                for axis, request in self.by_axis
            ),
        )
