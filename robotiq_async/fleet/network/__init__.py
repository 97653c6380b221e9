"""How agents and clients reach each other; zenoh stops here."""
