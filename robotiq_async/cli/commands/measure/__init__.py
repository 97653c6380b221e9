"""``robotiq-async measure speed`` and ``measure force``."""
