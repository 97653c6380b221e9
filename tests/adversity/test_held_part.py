"""Lives of a part that a jaw holds. In each of these it was lost once; ``make explore`` has more."""

from __future__ import annotations

import pytest

pytest.importorskip("mujoco", reason="needs the extra physics")

from tests.adversity.held_part import lived


@pytest.mark.parametrize("seed", [1, 2])
def test_nothing_lets_go_of_a_part(seed: int) -> None:
    life = lived(seed)
    assert not life.is_lost, (life.title, life.events, life.loosened)
