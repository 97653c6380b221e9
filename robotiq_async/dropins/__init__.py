"""Drop-ins: the interfaces that labs copy and their stacks look for, on any wire and model.

==============  ================================================================================
module          contents
==============  ================================================================================
``ur``          RobotiqGripper, the class of ``robotiq_gripper.py`` (UR's guides, GELLO)
``polymetis``   the gRPC server for DROID's robot, as a program
``lerobot``     LeRobot: the part that the robot class of an arm embeds, and a robot around it
``patience``    the wait of their calls for a link that is down
==============  ================================================================================

Import from these modules. None of this has run on real hardware yet.
"""
