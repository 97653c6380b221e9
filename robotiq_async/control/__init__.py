"""Decision logic: the state machine, and the next write after each read. No I/O, no clock, no event loop."""

# Theory of operation
#
# Three things are known, and every decision compares them:
#
# * the requests of callers: changes, holds and moves (pending.py, waiters.py), and one duty: a stop
#   (stops.py) or a procedure (procedures.py);
# * the images that the gripper may have, written by us or by others (ledger.py);
# * its condition, one of six (evidence.py), and which axes rest, may press, or move where
#   (rest.py).
#
# A status may change without a further write: our image may be on its way, or was lost with the link and
# still acts. So decisions about the next moments use the entries ahead in the ledger: the gate (rACT would
# rise after our reset), a halt (rGTO = 0 ends no activation), is_moving. Entries that a session leaves ahead
# are in doubt in the next session of the same gripper.
#
# A cycle is see(), then decide(); the first write of a stop is decided before the read, which may never be
# answered. An image is made from the base, the last image that the gripper has or is about to have. So an
# axis that is not addressed keeps its request. When an image sets rGTO again, each axis that holds nothing is
# commanded to its present position.
# Every image leaves through one gate (gate.py): only the requested procedure raises rACT or rATR, even if an
# image carries them along from another client or an older image. One race is left: if another client
# resets the gripper while a status is a device cycle old, an image with rACT activates it [follows]. That
# activation is taken back once it moves an axis, and by a stop at once.
#
# One write. A change is merged with others until the next write, then taken out and sent once, because it
# may move an axis. The acknowledgement answers its callers; a move waits on for its end. The write acts
# within a device cycle; a status shows it; a later one supersedes it. If the link goes down, every open call
# gets an error. A write that was not acknowledged is in doubt, and no command or hold is written for the time
# in which it may act. A speed or a force has no echo: it counts as acting a time after its acknowledgement.
#
# Holds only stop an axis, so they may be sent again. They are decided when they are written: an axis at rest
# or in contact keeps its request, and with it its grip. An axis that moves where it was in contact may press
# on its part again, and a hold there would end the grip: its hold waits until it reports the contact, or has
# moved off. Holds survive a lost link, unless another client has moved the axis since. A fault holds all axes
# that may move because of us: a minor fault clears without a reset [manual 2012, 4.7], and no axis must
# resume then.
#
# A stop goes before commands and holds: a halt, a reset, the end of the hand. It may be written again, as it
# only ends motion; stops.py has for each level when it is written, and when it is over. A halt that does not
# show after two writes fails. A halt and a reset fail with the link, too: sent later they would stop another
# client, or drop a part. Once it is back, axes that we move are held instead; and an activation or a release
# that they were to end, and that continues, is reset. A hand that was ending requests its stop again on a new
# link.
#
# Procedures raise rACT or rATR. While one runs, it alone judges the statuses. When it ends, none of our
# writes is on its way: the ledger begins again with our last image, and any other image is another client's.
# Our activations and releases are remembered until their end shows: stopping the hand ends them by a reset,
# and leaves others alone.
#
# Another client is noticed by a status that shows none of our images, also not with software limits instead
# of requests (limits.py), or by an activation that is not ours. Its writes between our last read and our next
# write are never noticed: our image repeats the older request of every axis. A noticed image is adopted: it
# becomes the base, the moves whose request is gone fail, the others continue, and our writes on their way are
# in doubt. An adopted axis gets time to show where it goes, or that it rests. A gripper that is found is
# written to for three reasons only: to hold axes that we moved, to reset a sequence that a stop was to end,
# and to activate it if the hand was told to.
#
# "Is it reached" is two questions: does the write act, and does a status show it. A status may be from before
# the write, and another client may have undone a write that acts.
#
# The state of the hand is a view of all this: _view() works out which of the fourteen holds, and
# values/states.py has the answer of each to a call.
#
# Evidence stands beside each rule: [manual] and [thesis] are printed, [seen] is from real grippers, [vendor]
# from the maker's examples, [follows] from Modbus and two clients alone, [conceivable] from caution alone.
# A rule without a mark is our promise, and needs no fact about the gripper. [manual 2014, p. 50] is a page
# as printed in that edition of the 3-Finger's instruction manual; the edition of 2012, for firmware 3.0, is
# cited by section. Where [manual] stands alone, the place was not noted.
