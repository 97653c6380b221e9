"""The state of a hand for a person who does not read the API: on the monitor's screen, on the page."""

from __future__ import annotations

from typing import Final

from ...values.enums import State

STATE_WORDS: Final = {
    State.DISCONNECTED: "lost",
    State.DO_ACTIVATION: "activating: the fingers move",
    State.WF_ACTIVATION: "activating: the fingers move",
    State.RUNNING_IDLE: "ready",
    State.RUNNING_CC: "ready",
    State.FAULT: "fault",
    State.DO_ATR: "releasing: the fingers open",
    State.WF_ATR: "releasing: the fingers open",
    State.ATR_DONE: "released: reset it",
    State.DO_RESET: "resetting",
    State.WF_RESET: "resetting",
    State.RESET: "reset: not active",
    State.DO_SHUTDOWN: "stopping",
    State.SHUTDOWN: "stopped",
}
