"""Transports: eight registers in, eight registers out, every byte checked. pymodbus stops here."""
