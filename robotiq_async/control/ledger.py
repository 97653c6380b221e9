"""The ledger: the images that the gripper has, had, or may get.

No I/O and no clock: callers give the time of a write, and questions are about that of the newest status.
"""

# The gripper's requests cannot be read back whole: speed and force have no echo [manual 2014, pp. 50-56], a
# write shows a device cycle late, and another client may write at any time. So each image is an entry, in the
# order in which they act:
#
# * sent: on the line. It may act already, or never.
# * acknowledged: it acts within a device cycle. The newest such entry is what the gripper has, or is about to
#   have: the base of the next image.
# * shown: a status has repeated its echo. A slow gripper may show an older one again, or skip one [follows];
#   one from before another client's image counts as that client's.
# * doubtful: the link went down before the acknowledgement, or another client's image showed first
#   [follows]. It may act, and is not the base: it is kept apart. If it shows, it is certain again, and so is
#   what was acknowledged after it.
#
# A status that shows no entry of the last half second shows another client's image, or a power cycle: that
# becomes the one certain entry, numbered before those that may still act. An entry that was replaced longer
# ago cannot show in an echo, and is forgotten. gDT may trail the echo [vendor]: the requests that it may be
# from are kept by axis.

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from itertools import takewhile
from operator import attrgetter
from typing import Final

from ..runtime.logger import Log, log
from ..values.enums import NO_AXES, Finger, ObjectStatus
from ..values.model import THREE_FINGER, Model
from ..values.registers import Echo
from ..values.request import AxisRequest, Request
from ..values.status import RobotiqStatus
from .adoption import Adoption
from .course import Course
from .entry import Entry, RecentRequests
from .limits import Limits
from .rest import LONG_AGO, Contacts, Moment, Rest, Target, drifts, may_move, rest_of

WINDOW_S: Final = 0.5
"""Time after its acknowledgement in which a write shows, if it acts: the slowest device cycle considered is
0.2 s [conceivable], and the poll that could show it may come late. It bounds what an echo can show."""
SILENT_S: Final = 0.25
"""Time in which a write acts where no echo shows it (speed, force; one that was lost with the link): the
slowest device cycle and 0.05 s."""
NEVER: Final = float("-inf")
_number: Final = attrgetter("number")


class Ledger:
    """The entries, the oldest first. Every axis has ``speed`` and ``force`` until they are set otherwise."""

    def __init__(
        self,
        speed: int,
        force: int,
        model: Model = THREE_FINGER,
        log: Log = log,
        before: Ledger | None = None,
        assumed: Mapping[tuple[Finger, str], int] | None = None,
    ) -> None:
        """``before`` is the ledger of the session before: what it has written may still act."""
        has = assumed or {}
        axes = tuple(
            AxisRequest(0, has.get((axis, "speed"), speed), has.get((axis, "force"), force))
            for axis in model.axes
        )
        first = Request(axes=axes, model=model)
        number: int = 0 if before is None else before.shown.number
        # The newest that showed.
        self.shown: Entry = Entry(number, first, first.echo, False, NEVER, NEVER, LONG_AGO)
        self.match: Entry | None = None  # the one that the newest status shows
        # When that was asked for. It may show the state of that time, however late a busy loop reads the
        # reply; so the age of a write is measured by this.
        self.now: Moment = Moment(0.0, 0)
        self.ours: Finger = NO_AXES  # the axes that may move because of us: we gave them their position
        self.unrested: Finger = NO_AXES  # those not known to have come to rest under their last request
        self.contacts: Final[Contacts] = Contacts() if before is None else before.contacts
        self.limits: Final = Limits(log)
        self._delay = 0.0  # seconds from sending to acting, at least, of the newest write that showed
        self._course: Final = Course()
        self._model: Final = model
        self._entries = deque([self.shown])  # those that are certain, and that a status may show
        # By number; each may act after those with a lower one.
        self._doubtful: list[Entry] = [] if before is None else before.waiting()
        for each in self._doubtful:
            log.info("the last hand of this gripper has left a request on its way: %s", each.image)
            each.overtaken(each.number)
        # The entry that showed as a status was adopted. It has left the ledger, but if this client wrote it,
        # it can still start an activation: after a reset our own image is taken for another client's.
        self._mistaken: Entry | None = None
        self._adoption: Adoption | None = None  # of another client's entry as long as that is the last
        # The axes that may still show a status from before their last request, with what they were asked: a
        # write that changes it puts an axis in, and a status that cannot be from before it takes it out. All
        # unrested ones are among them. Usually there is none, which spares a poll all questions about them.
        self._unproven: dict[Finger, RecentRequests] = {}

    # -- questions -------------------------------------------------------------------------------------

    @property
    def last(self) -> Entry:
        """The entry that the gripper has, or is about to have."""
        return self._entries[-1]

    @property
    def in_flight(self) -> Entry | None:
        """The entry that is on the line: neither acknowledged nor lost."""
        # One is written at a time, and no status is taken in meanwhile: only the last can be on the line.
        return self.last if self.last.acknowledged is None else None

    @property
    def _newest(self) -> Entry:
        """The one with the highest number: the last, or one in doubt."""
        last = self._entries[-1]
        return max(last, self._doubtful[-1], key=_number) if self._doubtful else last

    @property
    def base(self) -> Request:
        last = self.last
        return last.image if self._adoption is None else self._adoption.request(last.image.axes)

    @property
    def has_recent_doubt(self) -> bool:
        """Whether an entry in doubt may still act: an image from before it would undo it."""
        doubtful = self._doubtful  # usually there is none
        return bool(doubtful) and not all(map(self._is_past, doubtful))

    @property
    def is_certain(self) -> bool:
        is_known = self._adoption is None or self._adoption.is_certain
        return is_known and not self.has_recent_doubt

    @property
    def resting(self) -> Finger:
        """The axes that are known to rest under their last request, and those that the model lacks."""
        return Finger.ALL & ~self.unrested

    @property
    def is_settled(self) -> bool:
        """Whether every entry acts by now, or never will."""
        return self.acts(self._newest)

    def acts(self, entry: Entry) -> bool:
        """Whether an entry, or a later one, acts by now."""
        # It does when its echo has shown, or a long enough time after its acknowledgement.
        if entry.number <= self.shown.number:
            return True
        if entry is self.in_flight:
            return False
        age = self.now.time - entry.time
        if age >= WINDOW_S:
            return True
        # As long as those before it that wait have the same echo, no status shows which of them acts. Equal
        # images act at once; a speed or a force may take SILENT_S.
        return not any(
            each.echo != entry.echo or (age < SILENT_S and each.image != entry.image)
            for each in (self.shown, *self.waiting())
            if each.number < entry.number
        )

    def may_activate(self, status: RobotiqStatus) -> bool:
        """Whether a write of ours with rACT begins to act only in a status, or a short time before it."""
        known = (*self._entries, *self._doubtful, self._mistaken)
        ours = (each for each in known if each is not None and each.is_ours)
        activating = (each for each in ours if each.image.activate and each.echo == status.echo)
        return any(self.now.time - each.time < WINDOW_S for each in activating)

    def _may_get(self, is_meant: Callable[[Request], bool]) -> bool:
        """Whether such an image may still act; one in doubt may also never act."""
        # Every question about what the gripper may get is this one, whatever a status shows today.
        waiting = self.waiting()  # usually nothing does
        return bool(waiting) and any(
            is_meant(each.image) and not (self.acts(each) or self._is_past(each)) for each in waiting
        )

    @property
    def may_reset(self) -> bool:
        """Whether the gripper may be reset by the time at which the next image acts: its rACT would rise."""
        return self._may_get(lambda image: not image.activate)

    @property
    def may_set_go(self) -> bool:
        return self._may_get(lambda image: image.go)

    def may_drive(self, status: RobotiqStatus) -> bool:
        """Whether an activation or a release may begin, which rGTO = 0 does not end."""
        return self._may_get(lambda image: image.release or (image.activate and not status.activation_echo))

    @property
    def may_begin_to_move(self) -> bool:
        """Whether an image that does not act yet, or does not show in gDT yet, may start an axis."""
        return self.may_set_go or (bool(self.unrested) and self.shown.image.go)

    def gripping(self, status: RobotiqStatus) -> Finger:
        """The axes that are known to press on a part, or did when rGTO was cleared."""
        return self.contacts.pressing(status, self.base) & ~self.contacts.open

    def may_press(self, status: RobotiqStatus, since: float) -> Finger:
        """The axes that show a motion where they were in contact: not known yet whether they press again."""
        # An axis that moves has moved off before long. One that still shows a motion after that presses. That
        # it moves may be due to a force of another client, which no echo shows: so what counts is ``since``,
        # when that was first asked, and not our last write alone.
        is_recent = self.now.time - max(self.last.time, since) < WINDOW_S
        return self._pressing_again(status) if is_recent else NO_AXES

    def held(self, axes: Finger, status: RobotiqStatus, age: float = 0.0) -> dict[Finger, int]:
        """The axes of these that a hold must stop, and where it finds each; ``age`` is that of the status."""
        if not axes or not (base := self.base).go:
            return {}
        may_move, axes = self.may_move(status), axes & ~self._pressing_again(status)
        acts_in = age + self._delay  # the time until a write that leaves now acts
        return {
            axis: self._course.after(axis, base.position(axis), status, self.now.time, acts_in)
            for axis in status.model.axes
            if axis in axes and drifts(axis, base, status, may_move)
        }

    def _pressing_again(self, status: RobotiqStatus) -> Finger:
        # To hold one that presses would end its grip.
        return self.contacts.pressing(status, self.base) & status.moving

    def may_move(self, status: RobotiqStatus) -> Finger:
        """The axes that may move, or be about to, although the status shows them at rest."""
        moving = NO_AXES
        for axis, recent in self._unproven.items():
            what, position = status.finger_status(axis), status.position(axis)
            if may_move(recent.targets(self.now), self._model, what, position):
                moving |= axis
        return moving

    # -- what is written -------------------------------------------------------------------------------

    def write(self, image: Request, axes: Finger, now: float) -> Entry:
        """Add an image that is about to be sent, with new positions for ``axes``."""
        before = self._settle_base()
        entry = Entry(self._newest.number + 1, image, image.echo, is_ours=True, sent=now)
        self.limits.forget(axes)
        self.contacts.ask(axes)
        # With rGTO clear gDT has no meaning, so no axis was proven to rest under what was asked before.
        self._note_changes(entry, before, is_at_rest=before.go)
        self.ours |= axes
        self._entries.append(entry)
        return entry

    def _note_changes(self, entry: Entry, before: Request, *, is_at_rest: bool = False) -> Finger:
        """Note what an entry asks that differs from the image before it; return the axes."""
        image, changes = entry.image, NO_AXES
        is_switched = image.go is not before.go
        is_raised = is_switched and image.go and entry.is_ours
        for (axis, old), new in zip(before.by_axis, image.axes, strict=True):
            is_pressed = new.force > old.force
            is_new = is_switched or new.position != old.position
            # More force lets an axis in contact try again [conceivable]; one that moves keeps moving.
            if is_new or (is_pressed and not axis & self.unrested):
                recent = self._unproven.get(axis)
                if recent is None:
                    # What it replaces is unknown before another client's, if rGTO was clear.
                    known = before if before.go or entry.is_ours else image
                    replaced = Target(known.position(axis) if known.go else None)
                    recent = self._unproven[axis] = RecentRequests(axis, replaced, is_at_rest=is_at_rest)
                recent.add(entry, self.now, again=is_pressed or is_raised)
                changes |= axis
        if image.go and entry.is_ours:
            self.unrested |= changes
        return changes

    def acknowledge(self, now: float) -> None:
        self._newest.acknowledge(now)

    def lost(self, now: float = NEVER) -> None:
        """The link is down: a write without acknowledgement may have arrived at any time until now."""
        self._settle_base()
        if self.in_flight is not None:
            self.last.lose(now)
            self._doubtful = [*self._doubtful, self._entries.pop()]
            self._unproven = {axis: recent.without(self._doubtful) for axis, recent in self._unproven.items()}

    def _settle_base(self) -> Request:
        """End the adoption, so that no later status changes the base; return that."""
        base = self.base
        if self._adoption is not None:
            self.last.correct(base, self.last.echo)
            self._adoption = None
        return base

    # -- what is read ----------------------------------------------------------------------------------

    def update(self, status: RobotiqStatus, asked: float) -> None:
        """Take in a status: from then on the questions are about it."""
        before, entries = self.now, self._entries
        self.now = Moment(asked, before.reads + 1)
        # This comes before the status is looked at: after a silence it must not show an echo of long ago.
        while len(entries) > 1 and self._is_old(entries[1]):
            entries.popleft()
        # The common case first: nothing has changed since the last poll, and nothing waits to show. If others
        # wait, an echo of the entry shown before is its own unless a limit makes it ambiguous.
        shown = self.shown
        is_same = shown.echo == status.echo and shown.number >= entries[0].number
        if is_same and (shown is entries[-1] or not self.limits.has_alias(self.waiting)):
            self.match = shown
        else:
            self.match = self._find(status)
            # One with the echo of the image before shows only once that is forgotten: that tells no delay.
            if self.shown is not shown and self.shown.is_ours and self.shown.echo != shown.echo:
                self._delay = max(0.0, before.time - self.shown.sent)
        if self._doubtful:  # drop those that did not show in time, now that this status was compared
            later = (each for each in self._doubtful if each.number > self.shown.number)
            self._doubtful = [each for each in later if not self._is_old(each)]
        # A moving axis of another client shows its direction with time, an axis at rest its true gDT.
        if self._adoption is not None and self.match is self.last:
            self._adoption = self._adoption.after(status, self.now)

    def _is_past(self, entry: Entry) -> bool:
        """Whether an entry in doubt would have acted by now."""
        return entry in self._doubtful and self.now.time - entry.time >= SILENT_S

    def _is_old(self, entry: Entry) -> bool:
        return entry is not self.in_flight and self.now.time - entry.time > WINDOW_S

    def _find(self, status: RobotiqStatus) -> Entry | None:
        """The entry that a status shows, perhaps with software limits in place of its requests."""
        found = self._entry_of(status.echo)
        # A write in doubt may not have arrived: then another client explains the echo better.
        may_be_limit = found is None and not self._doubtful
        if may_be_limit and self.limits.explains(self.shown, self.waiting(), status, self.now.time):
            # Even so it may have to wait: while the echo has not changed, the write may not act yet.
            return self._entry_of(status.echo)
        return found

    def _entry_of(self, echo: Echo) -> Entry | None:
        """Of the entries that fit an echo the first after the one shown before."""
        # A control loop leaves a hundred entries in the window. Those that wait are few, and looked at first.
        for each in self.waiting():
            if each.echo == echo or self._shows_limit(each, echo):
                if each in self._doubtful:
                    self._revive(each)
                self.shown = each
                self.limits.settle(each, self._newest, echo)
                return each
        return next((each for each in self._entries if each.echo == echo), None)

    def _shows_limit(self, entry: Entry, echo: Echo) -> bool:
        # If the gripper showed the same echo before, the write may not act yet: then wait for SILENT_S.
        if self.shown.echo == echo and (
            entry.acknowledged is None or self.now.time - entry.acknowledged < SILENT_S
        ):
            return False
        return self.limits.shows(entry, echo)

    def waiting(self) -> list[Entry]:
        """The entries after the one that shows, the oldest first."""
        # Written out, because every write asks for it.
        shown, waiting = self.shown.number, []
        for each in reversed(self._entries):
            if each.number <= shown:
                break
            waiting.append(each)
        waiting.reverse()
        if not self._doubtful:
            return waiting
        doubtful = (each for each in self._doubtful if each.number > self._entries[0].number)
        return sorted((*waiting, *doubtful), key=_number)

    def _revive(self, entry: Entry) -> None:
        """An entry in doubt acts after all, and so will those that were acknowledged after it."""
        # Images act in their order [follows]. They are compared with the image that showed until now.
        self._settle_base()
        before = self.shown.image
        later = (each for each in self._doubtful if each.number > entry.number)
        revived = [entry, *(each for each in later if each.acknowledged is not None)]
        for each in revived:
            if each.acknowledged is None:  # its echo is its acknowledgement
                each.acknowledge(self.now.time)
            self.ours |= self._note_changes(each, before)
            before = each.image
        self._doubtful = [each for each in self._doubtful if each not in revived]
        self._entries = deque(sorted((*self._entries, *revived), key=_number))

    def adopt(self, status: RobotiqStatus, *, is_found: bool = False) -> None:
        """Make the image that a status shows the only certain entry; those that wait may act after it."""
        # A client that keeps writing must not make us wait again each time.
        since = self.now if self._adoption is None else self._adoption.since
        before = self._settle_base()
        self._note_acting()  # what has shown in a fault, for one: from here on nothing asks for it
        self._adoption = Adoption(since, status, status, self.now)
        image, time = self._adoption.request(before.axes), self.now.time
        other = Entry(self._newest.number + 1, image, status.echo, False, time, time, self.now)
        self._doubtful = self.waiting()
        for recent in self._unproven.values():
            recent.note_overtaken(self._doubtful, self.now)
        for number, each in enumerate(self._doubtful, other.number + 1):
            each.overtaken(number)
        self._note_changes(other, before)
        # If another client has activated the gripper, no axis moves because of us.
        moved = (axis for axis, old in before.by_axis if old.position != image.position(axis))
        self.ours = NO_AXES if is_found else self.ours & ~Finger(sum(moved))
        self._mistaken = self.match or self._mistaken
        self._entries, self.shown, self.match = deque([other]), other, other
        if is_found:
            self.contacts.forget()
        self.contacts.ask(Finger.ALL)

    def restart(self, status: RobotiqStatus) -> bool:
        """A procedure has ended: the gripper has its last image, and no other write is on its way."""
        # Return whether the status shows that image; if not, another client has written since. rATR has no
        # echo [manual 2014, p. 50]: while a gripper follows requests, an image with rATR counts as not shown.
        image, newest = self.base, self._newest
        number, time = newest.number + 1, newest.time
        self.shown = self.match = Entry(number, image, status.echo, True, time, time, LONG_AGO)
        self._entries, self._doubtful, self._unproven = deque([self.shown]), [], {}
        self._adoption = self._mistaken = None
        self.unrested, self.ours = NO_AXES, Finger.ALL
        self.contacts.forget()
        return status.echo == image.echo and not image.release

    # -- which axes rest -------------------------------------------------------------------------------

    def update_rest(self, status: RobotiqStatus) -> None:
        """Find out which axes have come to rest. Not in a fault: it keeps axes from starting."""
        if self._unproven:
            self._course.keep(status, self.now.time)
            self._note_acting()
            # gDT has no meaning without rGTO [manual]. While an adopted request is a guess, no rest follows
            # from it: a late gDT alone may make an axis look as if it was asked for where it is.
            if status.go_echo and (self._adoption is None or self._adoption.is_certain):
                self._find_rest(status)
        if status.go_echo and ((contacts := status.contacts) or self.contacts):
            if contacts & self.unrested:
                contacts &= ~self.may_move(status)
            self.contacts.see(status, contacts)

    def _note_acting(self) -> None:
        # Images act in their order, so what comes after one that does not act need not be looked at.
        waiting = {each for recent in self._unproven.values() for each in recent.waiting()}
        for each in takewhile(self.acts, sorted(waiting, key=_number)):
            # If the echo does not show when it began to act, the time for that and the lag end together.
            never_showed = each.number > self.shown.number and self.now.time - each.time >= WINDOW_S
            each.note_acting(LONG_AGO if never_showed else self.now)

    def _find_rest(self, status: RobotiqStatus) -> None:
        for axis in self._model.axes:
            recent = self._unproven.get(axis)
            if recent is None:
                continue
            what, position = status.finger_status(axis), status.position(axis)
            if what is ObjectStatus.IN_MOTION:
                recent.note_motion()
                continue
            rest = rest_of(recent.targets(self.now), self._model, what, position)
            if rest is not Rest.UNKNOWN and axis & self.unrested:
                self.unrested &= ~axis
                self.limits.note_rest(axis, status)
            if rest is Rest.PROVEN:
                del self._unproven[axis]
