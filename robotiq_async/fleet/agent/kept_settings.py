"""KeptSettings: the agent is the keeper of speeds and forces, also over its own restart.

They have no echo in the status, so only their writers know them. The agent keeps a value once the gripper has
acknowledged it: a value of unknown outcome never takes effect later.
"""

# Theory of operation
#
# A speed or a force changes in two ways alone: a client sets it, or a command moves its axis. The first
# motion of an axis under a new holder gets the values that this holder has set, else the values of the hand's
# options. So the force of an earlier client is not used for a part that this client moves, and a grip is not
# changed by a change of holder, by a hold or by a halt.
#
# While one client stays the last holder, nothing is restored, also after a loss of its lease: the gripper has
# its values. A hand that is started again has no memory of them, so it is given the values of the gripper.

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, Final

from ...local import RobotiqHand
from ...values import RUNNING, Finger, RobotiqError, SentRequest, Transition
from ..wire.settings import (
    SETTINGS,
    Setting,
    moved_by,
    read_settings,
    settings_fields,
    settings_in,
    settings_of,
)
from ..wire.values import Fields

_MOST_KEPT: Final = 64  # clients whose settings are kept; any program can make up clients


class KeptSettings:
    """The settings of the clients of one gripper, and of the gripper itself."""

    def __init__(self, hand: RobotiqHand, changed: Callable[[], object]) -> None:
        """``changed`` is called when the record has changed."""
        self._hand = hand
        self._changed = changed
        self._gripper: dict[Setting, int] = {}  # as of the newest acknowledged image
        self._of: dict[str, dict[Setting, int]] = {}  # by client, in the order of the last acknowledgments
        self._holder = ""  # the last one
        self._ordered: dict[Setting, int] = {}  # by the holder, on the way to the gripper
        self._has: set[Setting] = set()  # settings in which the gripper has the holder's value

    def grant(self, client: str) -> None:
        """A client gets the lease."""
        self.drop_orders()
        if client != self._holder:
            self._holder = client
            self._has.clear()

    def are_kept(self, client: str) -> bool:
        """Whether settings of a client are known."""
        return client in self._of

    def receive(self, settings: Mapping[Setting, int]) -> None:
        """Take the holder's settings that were carried out: the agent has not kept them."""
        self._of[self._holder] = dict(settings)
        self._changed()

    def ask(self, settings: Mapping[Setting, int]) -> None:
        """A command of this turn requests these: give the axes that it moves the holder's other settings."""
        self._ordered |= settings_of(settings)
        for axis in moved_by(settings) & self._hand.model.all_axes:
            own = {what: self._own(axis, what) for what in SETTINGS if self._is_missing((axis, what))}
            if own:
                with suppress(RobotiqError):  # the hand refuses the command, too
                    self._hand.command(axis, **own)

    def drop_orders(self) -> None:
        """The hand has dropped the requests that it had not sent."""
        self._ordered.clear()

    def end(self, settings: Mapping[Setting, int], *, is_done: bool) -> None:
        """A command has ended: its values were carried out, or are no longer on their way."""
        ended = {each: value for each, value in settings.items() if self._ordered.get(each) == value}
        if is_done:
            self._keep(ended)
        else:
            self._ordered = {each: value for each, value in self._ordered.items() if each not in ended}

    def observe(self, what: object) -> None:
        if isinstance(what, Transition) and what.target not in RUNNING:
            self.drop_orders()
        if not (isinstance(what, SentRequest) and what.acknowledged and what.request.activate):
            return
        before, self._gripper = self._gripper, settings_in(what)
        self._keep({each: v for each, v in self._ordered.items() if self._gripper.get(each) == v})
        self._has |= {each for each, value in self._gripper.items() if self._own(*each) == value}
        if before != self._gripper:
            self._changed()

    def _keep(self, settings: Mapping[Setting, int]) -> None:
        # The gripper has these of the holder.
        if settings:
            self._ordered = {each: value for each, value in self._ordered.items() if each not in settings}
            self._of[self._holder] = {**self._of.pop(self._holder, {}), **settings}
            if len(self._of) > _MOST_KEPT:
                del self._of[next(iter(self._of))]
            self._has |= settings.keys()
            self._changed()

    def _is_missing(self, setting: Setting) -> bool:
        return setting not in self._has and setting not in self._ordered

    def _own(self, axis: Finger, what: str) -> int:
        kept = self._of.get(self._holder, {}).get((axis, what))
        return int(getattr(self._hand.options, what)) if kept is None else kept

    @property
    def in_gripper(self) -> Mapping[Setting, int]:
        """The settings that the gripper has, as far as they are known."""
        return self._gripper

    @property
    def record(self) -> Fields:
        """The settings for the next run of the agent."""
        clients = {who: settings_fields(each) for who, each in self._of.items()}
        return {"gripper": settings_fields(self._gripper), "clients": clients}

    def resume(self, record: Mapping[str, Any]) -> None:
        """Continue from an earlier run. AttributeError, KeyError, TypeError, ValueError: malformed."""
        clients = {str(who): read_settings(each) for who, each in record["clients"].items()}
        self._gripper, self._of = read_settings(record["gripper"]), clients
