"""A write as the tests of links make it: of an image that is decided already."""

from __future__ import annotations

from collections.abc import Sequence

from robotiq_async.link import Link


async def write_image(link: Link, image: Sequence[int]) -> None:
    """Write an image, once."""
    assert await link.send(lambda: image)
