"""Tools around a hand: operate, record, view, measure, diagnose it; a page in the browser."""
