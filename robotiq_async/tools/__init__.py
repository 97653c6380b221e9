"""Tools around a hand: operate, record, view, measure, diagnose it; a page in the browser.

Products, beside each other:

===============  ======================================================================================
``recording``    for people who analyse the work of a hand: recordings (MCAP), read back, and as tables
``viewer``       for people who watch a hand from Foxglove or Lichtblick
``web``          for people who operate hands from a browser: a hand in three dimensions, and buttons
``metrics``      for people who supervise many hands: figures for Prometheus
``service``      for programs that run around hands for months: signals, health, systemd's watchdog
``doctor``       for people whose link does not work: findings with advice; nothing moves
``measure``      for people who need the speeds, forces and openings of their own gripper
``verify``       for people who meet a real gripper for the first time: guarded stages, and a report
``description``  for programs that plan motions or draw a gripper: URDF, SRDF and MJCF
===============  ======================================================================================

They share ``actions`` (the actions of a person on a hand), ``wording`` (states and refusals in plain words)
and ``errors``.
"""
