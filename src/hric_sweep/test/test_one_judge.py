"""A contact has the same finding in verdict, approaches, sweep outputs, benchmark and headline."""

import math
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point, Vector3
from made_up import run_metrics
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

import panda_description
from hric_analysis import contacts
from hric_assessment.findings import Finding, Outcome
from hric_assessment.verdict import AssessmentChoices, assess
from hric_assessment.verdict.result import Verdict
from hric_bags.memory import MemoryBag, nanoseconds
from hric_bags.reader import LOG_TYPE, RunMessages
from hric_bags.reader import read as read_record
from hric_core.parameters import read_yaml
from hric_core.robot_time.stamps import to_time
from hric_human.body import describe
from hric_human.participant.settings import HumanSettings
from hric_msgs.msg import ControlLog, JointTorque, RegionContact, RegionContacts
from hric_report import headline
from hric_run.definition import experiment
from hric_run.definition.experiment import to_dict
from hric_sweep import definition as sweep
from hric_sweep.approaches import command
from hric_sweep.benchmark import definition as benchmark
from hric_sweep.observed import Observations
from hric_sweep.outputs import SweepOutput
from hric_sweep.records import RunResponse

HAND = "hand, fingers"
BEGIN, HELD, END = 0.5, 1.2, 2.0
"""Time of the first touch, duration of the contact, end of the run [s]."""
ARM = [f"panda_joint{k}" for k in range(1, 8)]
POSTURE = [0.0, -0.4, 0.0, -1.8, 0.0, 1.4, 0.8]
"""Joint positions of the standing arm [rad]."""


def header(time: float) -> Header:
    return Header(stamp=to_time(time), frame_id="world")


def touched(time: float, region: str, force: float, kind: str) -> RegionContact:
    nowhere = (math.nan, math.nan, math.nan)
    known = force if kind == "penalty" else math.nan
    return RegionContact(
        regions=[region],
        link="r_wrist",
        other="panda::panda_hand",
        kind=kind,
        begin=BEGIN,
        duration=time - BEGIN,
        force=known,
        peak=known,
        peak_time=BEGIN,
        impulse=known * (time - BEGIN),
        area=math.nan,
        point=Point(*nowhere),
        normal=Vector3(*nowhere),
        begin_point=Point(*nowhere),
        begin_normal=Vector3(*nowhere),
        begin_speed=0.0,  # the arm stands
    )


def record_of(force: float, region: str, kind: str) -> tuple[MemoryBag, Any]:
    """Return bag and control log of a run in which a standing arm presses a body region with `force` [N] for HELD s."""
    bag, messages = MemoryBag(), RunMessages()
    body = describe(HumanSettings.of({"parts": "right_arm"}, "human").person)
    names, zeros = list(body.joints), [0.0] * len(body.joints)
    for k in range(round(END * 1000.0)):
        time = 0.001 * k
        if k % 10 == 0:
            rows, stamps = [0.0] * 70, (time + 0.001 * np.arange(10)).tolist()
            log = ControlLog(header(time), ARM, ["effort"] * 7, k, 10, stamps, POSTURE * 10, rows, rows, rows, rows)
            messages.add("/control_log", LOG_TYPE, bag.write("/control_log", log, time), log)
            states = JointState(header(time), names, zeros, zeros, zeros)
            bag.write("/hric/human/joint_states", states, time)
            load = JointTorque(header(time), names, zeros, zeros, [False] * len(names), [0] * len(names))
            bag.write("/hric/human/joint_torque", load, time)
        if BEGIN <= time <= BEGIN + HELD:
            one, ends = touched(time, region, force, kind), time + 5e-4 > BEGIN + HELD
            sent = RegionContacts(header(time), [] if ends else [one], [one] if ends else [])
            bag.write("/hric/human/contacts", sent, time)
        elif k % 50 == 0:
            bag.write("/hric/human/contacts", RegionContacts(header=header(time)), time)
    assert nanoseconds(END) > bag.end_time
    return bag, read_record(bag, messages)


def judged(force: float = 200.0, region: str = HAND, kind: str = "penalty") -> SimpleNamespace:
    """Return the verdict of a run, and the results of all other parts on its contact."""
    bag, record = record_of(force, region, kind)
    run = {"definition": to_dict(experiment.load("contact", ["simulator:=mujoco", "human.parts:=right_arm"]))}
    run["parameters"] = {"robot": {"plant": {}}}
    description = panda_description.load(hand=True)
    given = contacts.given_of(run, bag, description)
    verdict = assess(given, AssessmentChoices(contact_area=contacts.CONTACT_AREA))
    return SimpleNamespace(verdict=verdict, observed=Observations(run, bag, record, description))


@pytest.fixture(scope="module")
def clamp() -> Iterator[SimpleNamespace]:
    yield judged()


def contact_of(verdict: Verdict) -> Finding:
    (finding,) = [one for one in verdict.findings if one.group == "contact"]
    return finding


def number(path: str, values: Observations, **about: Any) -> float:
    return SweepOutput.of({"path": path, **about}, "output").measured(values)


def test_200_newton_on_a_hand_for_1_2_seconds_is_above_the_quasi_static_limit(clamp: SimpleNamespace) -> None:
    finding = contact_of(clamp.verdict)
    assert finding.outcome == Outcome.ABOVE and finding.share == pytest.approx(200.0 / 140.0)
    assert finding.reason.startswith("quasi-static force 200.0 of 140.0 N")


def test_approaches_have_the_finding_of_the_verdict(clamp: SimpleNamespace) -> None:
    finding = contact_of(clamp.verdict)
    (event,) = clamp.observed.contacts
    assert (event.outcome, event.share, event.reason) == (finding.outcome, finding.share, finding.reason)
    assert event.arm == "standing" and event.peak == 200.0
    names = read_yaml(sweep.find("approaches"))["sweep"]["outputs"]
    outputs = {
        name: number(values=clamp.observed, **about) for name, about in names.items() if "impact" in about["path"]
    }
    rest = dict.fromkeys(names, 0.0)
    text = command.report([RunResponse("", 0, rest | outputs)], 0, supervised=True)
    assert "contacts with a standing arm, by the person's own motion: in 1 of 1 runs (above limits in 1," in text


def test_an_output_of_a_sweep_has_the_finding_of_the_verdict(clamp: SimpleNamespace) -> None:
    assert number("impact.contacts.*.share", clamp.observed) == contact_of(clamp.verdict).share
    assert number("impact.contacts.*.above", clamp.observed, reduce="sum") == 1.0
    assert number("impact.moving.*.share", clamp.observed, reduce="count") == 0.0  # the arm stood as it began


def test_a_contact_without_a_known_force_is_no_run_without_contact() -> None:
    rigid = judged(kind="rigid").observed
    assert math.isnan(number("human.contacts.*.peak", rigid, otherwise=0.0))
    assert math.isnan(number("human.contacts.*.transient.ratio", rigid, otherwise=0.0))
    assert number("human.contacts.*.peak", rigid, reduce="count") == 0.0
    assert number("human.contacts.*.duration", rigid, reduce="count") == 1.0


@pytest.mark.parametrize(
    ("path", "about", "expected"),
    [
        ("setpoints.*.time", {}, math.nan),
        ("setpoints.*.time", {"unknown": 2.9}, 2.9),
        ("setpoints.*.time", {"unknown": 2.9, "reduce": "mean"}, 1.95),
        ("setpoints.*.time", {"otherwise": 0.0}, math.nan),
        ("setpoints.*.time", {"reduce": "count"}, 1.0),
        ("setpoints.-1.time", {"unknown": 2.9}, 2.9),
        ("setpoints.5.time", {"otherwise": 0.0}, 0.0),
        ("contacts.-1.peak", {"otherwise": 0.0}, 0.0),
        ("human.hand.path", {"otherwise": 0.0}, 0.0),
    ],
)
def test_a_null_is_not_known_and_what_a_run_does_not_have_is_otherwise(
    path: str, about: dict[str, object], expected: float
) -> None:
    run = {"setpoints": [{"time": 1.0}, {"time": None}], "contacts": [], "human": None}
    assert SweepOutput.of({"path": path, **about}, "output").measured(run) == pytest.approx(expected, nan_ok=True)


def test_the_benchmark_has_the_finding_of_the_verdict(clamp: SimpleNamespace) -> None:
    score = benchmark.load()[0].collaborations["contact"].findings["contact share"]
    share = score.measured(clamp.observed)
    assert share == contact_of(clamp.verdict).share and score.beyond(share)


def test_the_headline_has_the_finding_of_the_verdict(clamp: SimpleNamespace) -> None:
    pair = {"body_a": "human::r_wrist", "body_b": "panda::panda_hand", "kind": "penalty", "peak_force": 200.0}
    lines = headline.of_run({}, run_metrics(contacts=[pair]), clamp.verdict.to_dict())
    assert [one.name for one in lines] == ["Contact with the person", "Stability"]  # no bare force beside it
    assert (lines[0].value, lines[0].kind) == ("above limits, 143 % of the limit", headline.BAD)
    assert contact_of(clamp.verdict).reason in lines[0].meaning


@pytest.mark.parametrize(
    ("region", "kind", "outcome"),
    [("face", "penalty", Outcome.ABOVE), (HAND, "rigid", Outcome.NOT_ASSESSABLE)],
    ids=["a face", "a rigid pair"],
)
def test_what_no_number_proves_to_be_within_has_an_infinite_share(region: str, kind: str, outcome: Outcome) -> None:
    made = judged(5.0, region, kind)
    assert contact_of(made.verdict).outcome == outcome
    assert number("impact.contacts.*.share", made.observed, otherwise=0.0) == math.inf
    assert number("collaboration.contact.share", made.observed, otherwise=0.0) == math.inf


def test_a_light_touch_is_within_everywhere() -> None:
    made = judged(10.0)
    share = contact_of(made.verdict).share
    assert contact_of(made.verdict).outcome == Outcome.WITHIN and share is not None and share < 1.0
    assert number("impact.contacts.*.share", made.observed) == share
    assert number("collaboration.contact.share", made.observed) == share


@pytest.mark.parametrize("values", [[math.nan], [2.0, math.nan]])
def test_an_output_of_which_one_number_is_not_known_is_not_known(values: list[float]) -> None:
    assert math.isnan(number("contacts.*", {"contacts": values}, otherwise=0.0))  # type: ignore[arg-type]


def test_an_output_without_any_number_is_what_is_said_otherwise() -> None:
    assert number("contacts.*", {"contacts": []}, otherwise=0.0) == 0.0  # type: ignore[arg-type]
