"""The simulated gripper behind Modbus TCP and Modbus RTU."""
