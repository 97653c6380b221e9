"""The ledger: the images that the gripper has, had, or may get.

No I/O and no clock: callers give the time of a write, and answers hold for the time of the newest status.
"""

# The gripper's requests cannot be read back whole: speed and force have no echo [manual 2014, pp. 50-56], a
# write shows a device cycle late, and another client may write at any time. So each image is an entry, in the
# order in which they act:
#
# * sent: on the line. It may act already, or never.
# * acknowledged: it acts within a device cycle. The gripper has the newest such entry, or is about to have
#   it: the base of the next image.
# * shown: a status has repeated its echo. A slow gripper may show an older one again, or skip one [follows];
#   one from before another client's image counts as that client's.
# * doubtful: the link went down before it showed (a URCap acknowledges before its gripper), or another
#   client's image showed first [follows]. It may act, and is not the base. If it shows, it is certain again,
#   and so are entries that were acknowledged after it.
#
# The newest that showed divides the entries, and no entry has a number:
#
#             past                      ahead
#   [oldest .......... shown]  [next .......... newest]
#    may show again             may show, and then joins the past; entries before it go with it, or are
#                               dropped if they are in doubt
#
# Questions about the next moments (may the gripper be reset, may an axis start) are about the entries ahead
# that do not act yet by their time.
#
# A status that shows no entry of the last half second shows another client's image, or a power cycle: its
# image becomes the whole past, and entries ahead are in doubt. An entry that was replaced longer ago cannot
# show in an echo, and is forgotten. gDT may trail the echo [vendor]: rest.py has the requests that it may be
# from.

from __future__ import annotations

from collections import deque
from itertools import takewhile
from typing import Final

from ..runtime.logger import Log, log
from ..values.enums import NO_AXES, Fault, Finger, Trigger
from ..values.registers import Echo
from ..values.request import Request
from ..values.status import RobotiqStatus
from .adoption import Adoption
from .entry import Begun, Entry
from .evidence import classify, is_activating
from .limits import Limits
from .rest import Contacts, Moment, RecentRequests, drifts

WINDOW_S: Final = 0.5
"""Time after its acknowledgement in which a write shows, if it acts: the slowest device cycle considered is
0.2 s [conceivable], and the poll that could show it may come late. No older entry shows in an echo."""
SILENT_S: Final = 0.25
"""Time in which a write acts where no echo shows it (speed, force; a write lost with the link): the
slowest device cycle and 0.05 s."""
STRAY_COUNTS: Final = 10
"""An axis that moves further in an activation is driven by it. An axis that a stop catches at full speed
moves less: 10 counts take 0.09 s [thesis]."""
NEVER: Final = float("-inf")


class Ledger:
    """The entries, the oldest first.

    The ``first`` image was never written: it has the speed and the force of each axis until others are set.
    ``before`` is the ledger of the session before: its writes may still act.
    """

    def __init__(self, first: Request, log: Log = log, before: Ledger | None = None) -> None:
        # The certain entries that a status may show, up to the newest that showed; and the entries after it.
        # The tuple is replaced and never changed, as another thread may read whether something moves.
        self._past = deque([Entry(first, first.echo, False, NEVER, NEVER)])
        self.ahead: tuple[Entry, ...] = () if before is None else before.ahead
        for each in self.ahead:
            log.info("the last hand of this gripper has left a request on its way: %s", each.image)
            each.doubt(NEVER)
        self.match: Entry | None = None  # the one that the newest status shows
        # When the newest status was requested. It may show the state of that time even if a busy loop reads
        # the reply late; so the age of a write is measured by this.
        self.now: Moment = Moment(0.0, 0)
        self.ours: Finger = NO_AXES  # the axes that may move because of us: we gave them their position
        self.requests: Final = RecentRequests(first.model)
        self.contacts: Final[Contacts] = Contacts() if before is None else before.contacts
        self.limits: Final = Limits(log)
        # The activation or the release that ours have begun.
        self.begun: Begun | None = None if before is None else before.begun
        self._adoption: Adoption | None = None  # of another client's entry as long as that is the last
        self._delay = 0.0  # seconds from sending to acting, at least, of the newest write that showed

    # -- questions -------------------------------------------------------------------------------------

    @property
    def shown(self) -> Entry:
        """The newest entry that has shown."""
        return self._past[-1]

    @property
    def last(self) -> Entry:
        """The entry that the gripper has, or is about to have."""
        certain = [each for each in self.ahead if not each.is_doubtful]  # usually there is none
        return certain[-1] if certain else self._past[-1]

    @property
    def base(self) -> Request:
        last = self.last
        return last.image if self._adoption is None else self._adoption.request(last.image.axes)

    @property
    def has_recent_doubt(self) -> bool:
        """Whether an entry in doubt may still act: an image from before it would undo it."""
        return bool([each for each in self.ahead if each.is_doubtful and not self._is_past(each)])

    @property
    def is_certain(self) -> bool:
        is_known = self._adoption is None or self._adoption.is_certain
        return is_known and not self.has_recent_doubt

    @property
    def unsettled(self) -> tuple[Entry, ...]:
        """The entries that do not act yet: those ahead but for the first ones, which act by their time."""
        ahead, shown, is_equal, is_alike = self.ahead, self._past[-1], True, True
        for number, each in enumerate(ahead):  # usually there is none
            age = self._age(each)
            # While the echo stays the same, no status shows which of them acts. Equal images act at once; a
            # speed or a force may take SILENT_S.
            is_alike = is_alike and each.echo == shown.echo
            is_equal = is_equal and is_alike and each.image == shown.image
            is_alike = is_alike and (is_equal or age >= SILENT_S)
            if each.is_on_the_line or not (is_alike or age >= WINDOW_S):
                return ahead[number:]
        return ()

    @property
    def is_settled(self) -> bool:
        """Whether every entry acts by now, or never will."""
        return not self.unsettled

    def acts(self, entry: Entry) -> bool:
        """Whether an entry, or a later one, acts by now."""
        return entry not in self.unsettled

    @property
    def _coming(self) -> list[Request]:
        """The images that the gripper may still get, whatever a status shows today."""
        # Every question about its next moments is about these. An image in doubt may also never act.
        return [each.image for each in self.unsettled if not self._is_past(each)]

    @property
    def may_reset(self) -> bool:
        """Whether the gripper may be reset by the time at which the next image acts: its rACT would rise."""
        return any(not image.activate for image in self._coming)

    @property
    def may_set_go(self) -> bool:
        return any(image.go for image in self._coming)

    def may_drive(self, status: RobotiqStatus) -> bool:
        """Whether an activation or a release may begin, which rGTO = 0 does not end."""
        is_active = status.activation_echo
        return any(image.release or (image.activate and not is_active) for image in self._coming)

    @property
    def may_begin_to_move(self) -> bool:
        """Whether an image that does not act yet, or does not show in gDT yet, may start an axis."""
        return self.may_set_go or (bool(self.requests.unrested) and self.shown.image.go)

    def gripping(self, status: RobotiqStatus) -> Finger:
        """The axes that are known to press on a part, or did when rGTO was cleared."""
        return self.contacts.pressing(status, self.base) & ~self.contacts.open

    def may_press(self, status: RobotiqStatus, since: float) -> Finger:
        """The axes that were in contact and show a motion. Whether they press again is not known yet."""
        # An axis that moves has soon moved off. One that still shows a motion after that presses. The motion
        # may be due to a force of another client, which no echo shows: so ``since`` counts, when a hold was
        # first due, and not our last write alone.
        is_recent = self.now.time - max(self.last.time, since) < WINDOW_S
        return self._pressing_again(status) if is_recent else NO_AXES

    def held(self, axes: Finger, status: RobotiqStatus, age: float = 0.0) -> dict[Finger, int]:
        """The position of each of ``axes`` that a hold must stop, at the time at which the hold acts.

        ``age`` is the age of the status in seconds.
        """
        if not axes or not (base := self.base).go:
            return {}  # rGTO = 0 stops every axis [manual 2014, p. 50]
        may_move = self.requests.may_move(status, self.now)
        axes &= ~self._pressing_again(status)
        acts_in = age + self._delay  # the time until a write that leaves now acts
        return {
            axis: self.requests.course.after(axis, base.position(axis), status, self.now.time, acts_in)
            for axis in status.model.axes
            if axis in axes and drifts(axis, base, status, may_move)
        }

    def _pressing_again(self, status: RobotiqStatus) -> Finger:
        return self.contacts.pressing(status, self.base) & status.moving

    def _age(self, entry: Entry) -> float:
        """Seconds from its acknowledgement, or from its latest sending, to the newest status."""
        # Entry.time, written out: a stream comes here for each entry ahead at each poll.
        return self.now.time - (entry.acknowledged or entry.sent)

    def _is_over(self, entry: Entry) -> bool:
        """Whether the time in which an entry shows, if it acts, is over."""
        return self._age(entry) >= WINDOW_S and not entry.is_on_the_line

    def _is_past(self, entry: Entry) -> bool:
        """Whether an entry in doubt would have acted by now."""
        return entry.is_doubtful and self._age(entry) >= SILENT_S

    # -- writes ----------------------------------------------------------------------------------------

    def write(
        self, image: Request, axes: Finger, now: float, *, begins: bool = False, is_early: bool = False
    ) -> Entry:
        """Add an image that is about to be sent, with new positions for ``axes``."""
        before = self._settle_base()
        entry = Entry(image, image.echo, is_ours=True, sent=now, is_early=is_early)
        self.limits.forget(axes)
        self.contacts.ask(axes)
        # With rGTO clear gDT has no meaning, so no axis was proven to rest under earlier requests.
        self.requests.ask(entry, before, is_at_rest=before.image.go)
        self.ours |= axes
        self.ahead = (*self.ahead, entry)
        if begins:
            self.begun = Begun(entry)
        return entry

    def acknowledge(self, now: float) -> None:
        (self.ahead or self._past)[-1].acknowledge(now)

    def lost(self, now: float = NEVER) -> None:
        """The link is down: a write without acknowledgement may have arrived at any time until now."""
        self._settle_base()
        certain, echo = [each for each in self.ahead if not each.is_doubtful], self.shown.echo
        # A speed or a force alone cannot show: there the acknowledgement counts.
        kept = [*takewhile(lambda each: each.echo == echo and not each.is_on_the_line, certain)]
        for each in reversed(certain[len(kept) :]):
            each.doubt(now)
            self.requests.lose(each)

    def _settle_base(self) -> Entry:
        """End the adoption, so that no later status changes the base; return the entry that has it."""
        last = self.last
        if self._adoption is not None:
            last.correct(self._adoption.request(last.image.axes), last.echo)
            self._adoption = None
        return last

    # -- reads -----------------------------------------------------------------------------------------

    def update(self, status: RobotiqStatus, asked: float, *, is_ready: bool = False) -> None:
        """Take in a status: from then on the questions are about it. Unless it is news, axes rest by it."""
        before, past, shown = self.now, self._past, self._past[-1]
        self.now = Moment(asked, before.reads + 1)
        while len(past) > 1 and self._is_over(past[1]):
            past.popleft()
        # The common case first: nothing has changed since the last poll, and nothing is to show.
        is_same = not self.ahead and shown.echo == status.echo
        self.match = shown if is_same else self._find(status)
        newest = past[-1]
        # One with the echo of the image before shows only once that is forgotten: that tells no delay.
        if newest is not shown and newest.is_ours and newest.echo != shown.echo:
            self._delay = max(0.0, before.time - newest.sent)
        # A moving axis of another client shows its direction with time, an axis at rest its true gDT.
        if self._adoption is not None and self.match is newest:
            self._adoption = Adoption(self._adoption.since, self._adoption.first, status, self.now)
        if self.begun is not None and self._has_ended(self.begun.entry, status):
            self.begun = None
        if is_ready and self.match is not None:
            self.update_rest(status)

    def _find(self, status: RobotiqStatus) -> Entry | None:
        """The entry that a status shows, perhaps with software limits instead of its requests."""
        # After a silence it must not show an echo of long ago: of those whose time is over the newest alone.
        old = [*takewhile(self._is_over, self.ahead)]
        while old and old[-1].is_doubtful:
            old.pop()
        self.ahead = self.ahead[len(old) - 1 if old else 0 :]
        found = self._entry_of(status.echo, is_replaced=bool(old))
        # A write in doubt may not have arrived: then another client explains the echo better.
        may_be_limit = found is None and not [each for each in self.ahead if each.is_doubtful]
        if may_be_limit and self.limits.explains(self.shown, self.ahead, status, self.now.time):
            # Even so it may have to wait: while the echo has not changed, the write may not act yet.
            found = self._entry_of(status.echo, is_replaced=bool(old))
        # This status was compared with them: entries in doubt that did not show in time are dropped.
        self.ahead = tuple([each for each in self.ahead if not (each.is_doubtful and self._is_over(each))])
        return found

    def _entry_of(self, echo: Echo, *, is_replaced: bool) -> Entry | None:
        """Of the entries that fit an echo the first after the one shown before."""
        # The past cannot show any more if ``is_replaced``: an entry ahead has acted for too long.
        ahead, past, shown = self.ahead, self._past, self._past[-1]
        is_same, has_limits = shown.echo == echo and not is_replaced, bool(self.limits.known)
        for each in ahead:
            if (not is_same and each.echo == echo) or (has_limits and self._shows_limit(each, echo)):
                self._show(each)
                if has_limits:
                    self.limits.settle(each, self.last, echo)
                return each
        if is_replaced:
            return None
        return shown if is_same else next((each for each in past if each.echo == echo), None)

    def _shows_limit(self, entry: Entry, echo: Echo) -> bool:
        # If the gripper showed the same echo before, the write may not act yet: then wait for SILENT_S.
        may_wait = self.shown.echo == echo and (self._age(entry) < SILENT_S or entry.acknowledged is None)
        return not may_wait and self.limits.shows(entry, echo)

    def _show(self, entry: Entry) -> None:
        """An entry shows, so it acts even if it was in doubt, and so will entries acknowledged after it."""
        if entry.is_doubtful:
            # Images act in their order [follows]. They are compared with the image that showed until now.
            self._settle_base()
            before, start = self.shown, self.ahead.index(entry)
            for number, each in enumerate(self.ahead[start:], start + 1):
                if each is entry or (each.is_doubtful and each.acknowledged is not None):
                    each.believe(self.now.time)
                    self.ours |= self.requests.ask(each, before, later=self.ahead[number:])
                    before = each
        # Entries in doubt before it will never act.
        count = self.ahead.index(entry) + 1
        self._past.extend([each for each in self.ahead[:count] if not each.is_doubtful])
        self.ahead = self.ahead[count:]

    def _has_ended(self, begun: Entry, status: RobotiqStatus) -> bool:
        """Whether the activation or the release of an entry is over. A status may be from before it."""
        condition = classify(status)
        if not begun.image.release:
            # A fault does not end it: the fingers may continue when that clears [conceivable].
            return (status.is_activated or condition is Trigger.SEEN_RESET) and self.acts(begun)
        if status.is_reset or status.fault is Fault.AUTOMATIC_RELEASE:
            return condition in (Trigger.SEEN_RESET, Trigger.SEEN_RELEASED) and self.acts(begun)
        return self._is_over(begun)  # it never began, or another client has activated the gripper

    def sees_stray(self, status: RobotiqStatus) -> bool:
        """Whether a status shows an activation that our rACT has begun unasked, and that moves an axis."""
        if self.begun is None and is_activating(status):
            # A write with rACT begins to act only in this status, or has a short time before it.
            ours = (each for each in (*self._past, *self.ahead) if each.is_ours and each.echo == status.echo)
            if any(each.image.activate and self._age(each) < WINDOW_S for each in ours):
                self.begun = Begun(self.last, status)
        if self.begun is None or (first := self.begun.first) is None:
            return False
        axes = status.model.axes
        return max(abs(status.position(axis) - first.position(axis)) for axis in axes) > STRAY_COUNTS

    def adopt(self, status: RobotiqStatus, *, is_found: bool = False) -> None:
        """Make the image that a status shows the only certain entry; entries ahead may act after it."""
        # A client that keeps writing must not make us wait again each time.
        since = self.now if self._adoption is None else self._adoption.since
        before = self._settle_base()
        self._adoption = Adoption(since, status, status, self.now)
        image, time = self._adoption.request(before.image.axes), self.now.time
        other = Entry(image, status.echo, False, time, time)
        for each in self.ahead:
            each.doubt(NEVER)
        self.requests.overtake(self.now)
        self.requests.ask(other, before)
        # If another client has activated the gripper, no axis moves because of us.
        moved = (axis for axis, old in before.image.by_axis if old.position != image.position(axis))
        self.ours = NO_AXES if is_found else self.ours & ~Finger(sum(moved))
        # One with this echo stays: after a reset our own image is taken for another client's, and if this
        # client wrote it, it can still start an activation.
        kept = [each for each in self._past if each.echo == status.echo]
        self._past, self.match = deque([*kept, other]), other
        if is_found:
            self.contacts.forget()
        self.contacts.ask(Finger.ALL)

    def restart(self, status: RobotiqStatus) -> bool:
        """Begin again after a procedure: the gripper has its last image, and no other write is on its way.

        Returns whether the status shows that image; if not, another client has written since.
        """
        # rATR has no echo [manual 2014, p. 50]: while a gripper follows requests, an image with rATR counts
        # as not shown.
        image, time = self.base, (self.ahead or self._past)[-1].time
        self.match = Entry(image, status.echo, True, time, time)
        self._past, self.ahead = deque([self.match]), ()
        self._adoption, self.ours = None, Finger.ALL
        self.requests.forget()
        self.contacts.forget()
        return status.echo == image.echo and not image.release

    def update_rest(self, status: RobotiqStatus) -> None:
        """Find out which axes have come to rest. Not in a fault: it keeps axes from starting."""
        if self.requests.targets:
            # gDT has no meaning without rGTO [manual]. While an adopted request is a guess, no rest follows
            # from it: a late gDT alone may make an axis look as if it was asked for where it is.
            is_known = status.go_echo and (self._adoption is None or self._adoption.is_certain)
            for axis in self.requests.see(status, self.now, self.unsettled, is_known=is_known):
                self.limits.note_rest(axis, status)
        if status.go_echo and ((contacts := status.contacts) or self.contacts.shown):
            if contacts & self.requests.unrested:
                contacts &= ~self.requests.may_move(status, self.now)
            self.contacts.see(status, contacts)
