"""The device: axes, contacts, faults, and the registers it reports. No I/O; its clock is injected.

``gripper`` takes and gives registers, ``inbox`` keeps writes until they act, ``controller`` is the firmware
with its habits, ``axis`` an axis by figures, ``driven_axis`` an axis that bodies move (``mechanics``).
"""
