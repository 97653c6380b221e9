"""The device: axes, contacts, faults, and the registers it reports. No I/O; its clock is injected.

``gripper`` takes and gives registers, ``inbox`` keeps writes until they act, ``controller`` is its
firmware with its habits, ``axis`` its axes, ``driven_axis`` those that bodies move (``mechanics``).
"""
