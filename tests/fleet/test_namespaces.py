"""One direction cut around the link lease, with zenoh itself: nothing may come to the wrong gripper."""

from __future__ import annotations

import pytest

from tests.fleet import cuts

pytest.importorskip("zenoh")


@pytest.mark.skipif(bool(cuts.missing()), reason=cuts.missing() or "here it can")
async def test_nothing_comes_to_the_wrong_gripper() -> None:
    try:
        came = await cuts.marathon(3)
    except RuntimeError as error:
        pytest.skip(f"no network namespaces or no nftables here: {error}")
    assert came["wrong"] == 0
    assert came["moved by the wrong client"] == {"left": 0, "right": 0}
    assert min(came["heard"].values()) > 100
    assert min(came["writes"].values()) > 20
