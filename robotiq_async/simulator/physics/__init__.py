"""The device: axes, contacts, faults, and the registers it reports. No I/O; its clock is injected.

``gripper`` takes and gives registers, ``surroundings`` acts on it from outside, ``controller`` is its
firmware with its habits, ``axis`` its axes, ``driven_axis`` those that bodies move (``mechanics``).
"""
