"""The rules for alarms, read as Prometheus reads them, on the figures of real hands."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import pytest
from prometheus_client.parser import text_string_to_metric_families

from robotiq_async import Fault, Finger, RobotiqHand, State
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.metrics import serve_metrics
from tests.grippers import lose_link
from tests.tools.test_metrics import page

yaml = pytest.importorskip("yaml", reason="the rules are written in it")

FILE = Path(__file__).parents[2] / "packaging" / "robotiq.rules.yml"
RULES = {rule["alert"]: rule for rule in yaml.safe_load(FILE.read_text())["groups"][0]["rules"]}
Labels = frozenset[tuple[str, str]]
Vector = dict[Labels, float]


def vectors(text: str, up: float = 1.0) -> dict[str, Vector]:
    """The series of Prometheus after a scrape: by name, the value of each set of labels."""
    target = {("instance", "cell:9100"), ("job", "robotiq")}
    found: dict[str, Vector] = {"up": {frozenset(target): up}}
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            found.setdefault(sample.name, {})[frozenset(target | set(sample.labels.items()))] = sample.value
    return found


TERM = re.compile(
    r"\s*(?P<name>\w+)(?:{(?P<label>\w+)=\"(?P<value>[^\"]*)\"})?\s*(?P<sign>==|>)\s*(?P<limit>\d+)"
)
SET = re.compile(r"\s*(?P<operator>or|unless)(?:\s+on\s*\((?P<on>[\w, ]+)\))?(?=\s)")


def evaluated(rule: str, data: Mapping[str, Vector]) -> Vector:
    """The little of PromQL that the rules use: comparisons, joined by sets from left to right."""
    found, at = compared(rule, 0, data)
    while (joined := SET.match(rule, at)) is not None:
        right, at = compared(rule, joined.end(), data)
        on = {name.strip() for name in (joined["on"] or "").split(",")}
        if joined["operator"] == "or":
            found = {**right, **found}
        else:
            keys = {frozenset(pair for pair in each if pair[0] in on) for each in right}
            found = {
                each: value
                for each, value in found.items()
                if frozenset(pair for pair in each if pair[0] in on) not in keys
            }
    assert not rule[at:].strip(), rule
    return found


def compared(rule: str, at: int, data: Mapping[str, Vector]) -> tuple[Vector, int]:
    term = TERM.match(rule, at)
    assert term is not None, rule[at:]
    wanted = {(term["label"], term["value"])} if term["label"] else set()
    limit, is_equal = float(term["limit"]), term["sign"] == "=="
    vector = {each: value for each, value in data.get(term["name"], {}).items() if wanted <= each}
    return {each: v for each, v in vector.items() if (v == limit if is_equal else v > limit)}, term.end()


def alarms(text: str, up: float = 1.0) -> set[str]:
    """The alerts that begin to wait for their time."""
    data = vectors(text, up)
    return {name for name, rule in RULES.items() if evaluated(rule["expr"], data)}


def series(text: str) -> set[str]:
    """The series of conditions, without their values."""
    names = (
        "robotiq_fault{",
        "robotiq_ready{",
        "robotiq_holds{",
        "robotiq_inhibited{",
        "robotiq_status_age_s",
    )
    return {line.rpartition(" ")[0] for line in text.splitlines() if line.startswith(names)}


def test_the_rules_are_three_and_name_the_hand() -> None:
    assert set(RULES) == {"RobotiqFault", "RobotiqNotReady", "RobotiqSilent"}
    for rule in RULES.values():
        assert rule.keys() <= {"alert", "expr", "for", "annotations"}
        assert "$labels.hand" in rule["annotations"]["summary"]


def test_a_parser_of_promql_reads_them() -> None:
    promql = pytest.importorskip("promql_parser", reason="of its own: pip install promql-parser")
    for rule in RULES.values():
        promql.parse(rule["expr"])


async def test_what_they_say_in_each_condition() -> None:
    gripper = SimulatedGripper(speedup=20, spread=False)
    async with (
        SimulatorServer(gripper) as server,
        RobotiqHand(server.address, name="cell") as hand,
        serve_metrics(hand, port=0) as where,
    ):
        assert alarms(first := await page(where)) == set()
        assert alarms("", up=0.0) == {"RobotiqSilent"}
        gripper.place_object(Finger.ABC, position=120)
        await hand.grasp()
        assert 'robotiq_holds{hand="cell"} 3.0' in await page(where)
        await hand.inhibit("HALT was pressed")
        inhibited = await page(where)
        assert 'robotiq_inhibited{hand="cell"} 1.0' in inhibited
        assert 'robotiq_ready{hand="cell"} 0.0' in inhibited
        assert alarms(inhibited) == set(), "a person knows"
        await hand.permit()
        gripper.inject_fault(Fault.SCISSOR_BLOCKED)
        await hand.wait_for_state(State.FAULT)
        faulty = await page(where)
        assert alarms(faulty) == {"RobotiqFault", "RobotiqNotReady"}
        ones = [line for line in faulty.splitlines() if line.startswith("robotiq_fault{") and "} 1" in line]
        assert len(ones) == 1
        assert 'code="0x0E"' in ones[0]
        assert 'name="SCISSOR_BLOCKED"' in ones[0]
        await lose_link(server, hand)
        lost = re.sub(r"(status_age_seconds{.*}) .*", r"\1 5.1", await page(where))  # later
        assert alarms(lost) >= {"RobotiqSilent", "RobotiqNotReady"}
        assert series(first) == series(faulty) == series(lost), "no label grows"
