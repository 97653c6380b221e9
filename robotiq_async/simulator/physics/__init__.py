"""What the gripper does: axes, contacts, faults, and the words it reports. No I/O; its clock is injected.

``gripper`` takes and gives registers, ``surroundings`` is what happens to it, ``controller`` its firmware
with the habits it has, ``axis`` its axes, ``driven_axis`` those that bodies move (``mechanics``).
"""
