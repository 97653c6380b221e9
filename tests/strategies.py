"""Examples for hypothesis that several files of tests use."""

from __future__ import annotations

from typing import Final

from hypothesis import strategies as st

from tests.register_words import registers_of, request_of

ANY: Final = st.characters(exclude_categories=["Cs"])
"""The characters of UTF-8. To try all of that codec, as st.text() does by itself, takes a second."""

# One draw of bytes is cheaper than one for each field, and shrinks as well.
BLOCKS: Final = st.binary(min_size=16, max_size=16).map(registers_of)
"""Any eight registers."""
REQUESTS: Final = st.binary(min_size=14, max_size=14).map(request_of)
"""Any request."""
