"""Axes, their motors and what makes one differ from another; a scale between the fingers."""
