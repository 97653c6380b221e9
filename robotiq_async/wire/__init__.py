"""The gripper's registers: what is asked in eight of them and what is answered in eight others. Pure."""
