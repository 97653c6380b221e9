"""Lives of a part that is held. In some of these it was lost once; ``make explore`` has more."""

from __future__ import annotations

import pytest

pytest.importorskip("mujoco", reason="needs the extra physics")

from robotiq_async.values.model import HAND_E, THREE_FINGER, TWO_FINGER_85, TWO_FINGER_140, Model
from tests.adversity.held_part import lived


@pytest.mark.parametrize(
    ("seed", "model"),
    [(1, TWO_FINGER_85), (2, TWO_FINGER_140), (6, HAND_E), (10, HAND_E), (1, THREE_FINGER)],
    ids=str,
)
def test_nothing_lets_go_of_a_part(seed: int, model: Model) -> None:
    life = lived(seed, model=model)
    assert not life.is_lost, (life.title, life.events, life.loosened)
