"""The text port of Robotiq's URCap on a UR controller: another kind of link than Modbus."""
