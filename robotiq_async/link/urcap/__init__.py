"""The text port of Robotiq's URCap on a UR controller: a link of its own beside Modbus."""
