"""A simulated gripper in the tests of applications: fixtures for pytest.

pytest finds them by itself where ``robotiq_async`` is installed; :mod:`.plugin` lists them. This is a
separate package because pytest imports it into every run in such an environment: ``robotiq_async``, with some
two hundred modules, comes with the first fixture that is used.
"""
