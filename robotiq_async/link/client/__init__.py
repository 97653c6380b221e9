"""The client of pymodbus behind a transport: how it is connected, and how long an answer may take."""
