"""Decision logic: the state machine, and the next write after each read. No I/O, no clock, no event loop."""

# Theory of operation
#
# Three things are known, and every decision compares them:
#
# * what callers have asked: changes, holds and moves (pending.py, waiters.py), and one duty: a stop
#   (stops.py) or a procedure (procedures.py);
# * what the gripper may have: the images written, by us or by others (ledger.py);
# * what it shows: one of six conditions (evidence.py), and which axes rest, may press, or move where
#   (rest.py).
#
# What a status shows may change without a further write: an image of ours may be on its way, or was lost
# with the link and acts all the same. So whoever asks what the gripper will do asks the ledger for what is
# ahead: the gate (rACT would rise after a reset of ours), a halt (rGTO = 0 ends no activation), is_moving.
# What a session leaves ahead is in doubt in the next one of the same gripper.
#
# A cycle is see(), then decide(); the first write of a stop is decided before the read, which may never be
# answered. An image is made from the base, the last image that the gripper has or is about to have. So an
# axis that is not addressed keeps its request. When an image sets rGTO again, each axis that holds nothing is
# commanded to its present position.
# Every image leaves through one gate (gate.py): only the procedure that was asked for raises rACT or rATR,
# whatever an image carries along from another client or an older one. One race is left: if another client
# resets the gripper while a status is a device cycle old, an image with rACT activates it [follows]. That
# activation is taken back once it moves an axis, and by a stop at once.
#
# One write. A change is merged with others until the next write, then taken out and sent once, because it
# may move an axis. The acknowledgement answers its callers; a move waits on for its end. The write acts
# within a device cycle; a status shows it; a later one supersedes it. If the link goes down, every open call
# gets an error. A write that was not acknowledged is in doubt, and no command or hold is written for the time
# in which it may act. A speed or a force has no echo: it counts as acting a time after its acknowledgement.
#
# Holds only stop an axis, and are decided when they are written: an axis at rest or in contact keeps its
# request, and with it its grip. One that moves where it was in contact may press on its part again, and to
# hold it there would end the grip: its hold waits until it reports the contact, or has moved off. So they
# may be sent again. They survive a lost link, unless another client has moved the axis since. A fault puts
# a hold on all axes that may move because of us: a minor fault clears without a reset [manual 2012, 4.7],
# and nothing must resume then.
#
# A stop goes before commands and holds: a halt, a reset, the end of the hand. It may be written again, as it
# only ends motion; stops.py has for each level when it is written, and when it is over. A halt that does not
# show after two writes fails. A halt and a reset fail with the link, too: sent later they would stop another
# client, or drop a part. Once it is back, what we move is held instead; and an activation or a release
# that they were to end, and that continues, is reset. A hand that was ending asks for its stop again on a new
# link.
#
# Procedures raise rACT or rATR. While one runs, it alone judges what a status shows. When it ends, no write
# of ours is on its way: the ledger begins again with our last image, and what shows in place of it is another
# client's. An activation and a release of ours are remembered until their end shows: stopping the hand ends
# them by a reset, and leaves those of others alone.
#
# Another client is seen by a status that shows none of our images, nor one with software limits in place of
# requests (limits.py), or by an activation that is not ours. What it writes between our last read and our
# next write is never seen: our image repeats the older request of every axis. What is seen is adopted: its
# image becomes the base, the moves whose request is gone fail, the others continue, and our writes on their
# way are in doubt. An adopted axis gets time to show where it goes, or that it rests. A gripper that is found
# is written to for three reasons only: to hold what we moved, to reset what a stop was to end, and to be
# activated if the hand was told to.
#
# "Is it reached" is two questions: does the write act, and does a status show it. What shows may be from
# before the write, and what acts may have been undone by another client.
#
# The state of the hand is a view of all this: _view() works out which of the fourteen holds, and
# values/states.py has what each answers to a call.
#
# Evidence stands beside each rule: [manual] and [thesis] are printed, [seen] is from real grippers, [vendor]
# from the maker's examples, [follows] from Modbus and two clients alone, [conceivable] from nothing but care.
# A rule without one is a promise of ours, and needs no fact about the gripper. [manual 2014, p. 50] is a page
# as printed in that edition of the 3-Finger's instruction manual; the edition of 2012, for firmware 3.0, is
# cited by section. Where [manual] stands alone, the place was not noted.
