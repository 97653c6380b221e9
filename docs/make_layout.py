"""The layout for Foxglove and Lichtblick: what ``robotiq-async view`` shows.

The file lies in the package, so that an installed command can hand it out; make_pages.py writes it.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

from robotiq_async.tools.description import hand_model
from robotiq_async.values.enums import Fault, Severity, State
from robotiq_async.values.model import MODELS, THREE_FINGER

FILE: Final = Path(__file__).parents[1] / "robotiq_async" / "data" / "foxglove_layout.json"
GREEN, YELLOW, RED, GREY = "#4caf50", "#ffb300", "#e53935", "#9e9e9e"
COLOURS: Final = {
    Severity.NONE: GREEN,
    Severity.PRIORITY: YELLOW,
    Severity.MINOR: YELLOW,
    Severity.MAJOR: RED,
}
STATES: Final = {
    State.RUNNING_IDLE: GREEN,
    State.RUNNING_CC: GREEN,
    State.DISCONNECTED: RED,
    State.FAULT: RED,
}

Panel = dict[str, Any]


def draw() -> str:
    """The file's text."""
    curves = _stacked("Plot!positions", _stacked("Plot!currents", "StateTransitions!states", 60), 40)
    layout = {
        "configById": panels(),
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _side_by_side(
            _stacked(
                _side_by_side("Indicator!state", "Indicator!fault"),
                _stacked("3D!hand", curves, 40),
                12,
            ),
            "RawMessages!state",
            65,
        ),
    }
    return json.dumps(layout, indent=1) + "\n"


def panels() -> dict[str, Panel]:
    """Every panel by its name."""
    names = [str(axis.name) for axis in THREE_FINGER.axes]
    states = [(state.name, STATES.get(state, YELLOW), state.name) for state in State]
    faults = [
        (str(int(fault)), COLOURS[fault.severity], fault.description)
        for fault in Fault
        if fault is THREE_FINGER.faults[int(fault)]
    ]
    series = [("state", "/gripper/event.target"), *((n, f"/gripper/status.{n}.axis_state") for n in names)]
    return {
        "Indicator!state": _indicator("state", states),
        "Indicator!fault": _indicator("fault_code", faults),
        "3D!hand": _hand(),
        "Plot!positions": _plot("Positions", [(name, f"{name}.position") for name in names]),
        "Plot!currents": _plot("Currents in mA", [(name, f"{name}.current_ma") for name in names]),
        "StateTransitions!states": {
            "foxglovePanelTitle": "State and axes",
            "lichtblickPanelTitle": "State and axes",
            "isSynced": True,
            "paths": [{"label": label, "value": v, "timestampMethod": "receiveTime"} for label, v in series],
        },
        "RawMessages!state": {"topicPath": "/gripper/state", "diffEnabled": False, "expansion": "all"},
    }


def _indicator(field: str, rules: list[tuple[str, str, str]]) -> Panel:
    return {
        "path": f"/gripper/state.{field}",
        "style": "background",
        "fallbackColor": GREY,
        "fallbackLabel": "unknown",
        "rules": [
            {"operator": "=", "rawValue": value, "color": colour, "label": label}
            for value, colour, label in rules
        ],
    }


def _hand() -> Panel:
    """The hand with its fingers up: out of the palm is y, and the camera looks down at x and y."""
    model = hand_model()
    return {
        "foxglovePanelTitle": "Hand",
        "lichtblickPanelTitle": "Hand",
        "followMode": "follow-pose",
        "followTf": model.root,
        "cameraState": {
            "perspective": True,
            "distance": 0.5,
            "phi": 35,
            "thetaOffset": 25,
            "targetOffset": [0, 0.06, 0],
            "fovy": 45,
            "near": 0.01,
            "far": 100,
        },
        "topics": {name: {"visible": True} for name in ("/robot_description", "/gripper/parts")},
        # Their axes would be metres long, and the hand is not.
        "scene": {"transforms": {"showLabel": False, "axisScale": 0.03}},
        "transforms": {
            f"frame:{link}": {"visible": False} for kind in MODELS for link in hand_model(kind).links
        },
    }


def _plot(title: str, fields: list[tuple[str, str]]) -> Panel:
    return {
        "foxglovePanelTitle": title,
        "lichtblickPanelTitle": title,
        "paths": [
            {
                "label": label,
                "value": f"/gripper/status.{field}",
                "enabled": True,
                "timestampMethod": "receiveTime",
            }
            for label, field in fields
        ],
        "showLegend": True,
        "legendDisplay": "floating",
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "showPlotValuesInLegend": True,
        "isSynced": True,
        "xAxisVal": "timestamp",
        "followingViewWidth": 30,
    }


def _side_by_side(first: object, second: object, percent: float = 50) -> object:
    return {"direction": "row", "first": first, "second": second, "splitPercentage": round(percent, 1)}


def _stacked(first: object, second: object, percent: float = 50) -> object:
    return {"direction": "column", "first": first, "second": second, "splitPercentage": round(percent, 1)}
