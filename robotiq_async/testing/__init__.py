"""A simulated gripper in the tests of applications: fixtures for pytest.

pytest finds them by itself where ``robotiq_async`` is installed; :mod:`.plugin` lists them. Nothing else of
the library imports this, and this imports nothing of it before a fixture is used.
"""
