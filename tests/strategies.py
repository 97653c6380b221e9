"""Examples for hypothesis that several files of tests use."""

from __future__ import annotations

from typing import Final

from hypothesis import strategies as st

ANY: Final = st.characters(exclude_categories=["Cs"])
"""The characters of UTF-8. To try all of that codec, as st.text() does by itself, takes a second."""
