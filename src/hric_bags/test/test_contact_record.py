"""Contact forces in a run's metrics and report, and which of them may be assessed."""

from pathlib import Path

import pytest
from geometry_msgs.msg import Wrench
from synthetic import write_run

from gazebo_msgs.msg import ContactsState, ContactState
from hric_bags.records import contact_record
from hric_bags.records.contact_record import RigidForceError
from hric_control.plant import Contact
from hric_control.sim.topics import contacts_message
from hric_core.robot_time.stamps import to_time
from hric_report.run import analyse
from hric_run.bag_writer import BagWriter

HAND, WALL = "panda::panda_hand", "wall::link"


def contact(force, kind, a=HAND, b=WALL):
    return Contact(a, b, (0.6, 0.0, 0.5), (-1.0, 0.0, 0.0), 0.001, force, kind)


def bag(path: Path, *messages):
    with BagWriter(path) as writer:
        for message in messages:
            writer.write("/sim/contacts", message, message.header.stamp.to_sec())
    return path


def test_the_peak_is_that_between_the_messages_and_both_orders_of_a_pair_are_one(tmp_path):
    path = bag(
        tmp_path / "a.bag",
        contacts_message([contact(80.0, "penalty")], 1.0, {(HAND, WALL): 95.0}),
        contacts_message([], 1.01, {(HAND, WALL): 152.34}),
        contacts_message([contact(10.0, "penalty", WALL, HAND)], 1.02, {(WALL, HAND): 20.0}),
        contacts_message([], 1.03),
    )
    (pair,) = contact_record.read(path, lambda stamp: stamp - 1.0)
    assert (pair.body_a, pair.body_b, pair.kind, pair.peak_force) == (HAND, WALL, "penalty", 152.34)
    assert (pair.time, pair.first, pair.last) == pytest.approx((0.01, 0.0, 0.02))
    assert contact_record.assessable([pair]) == [pair]


def test_a_rigid_force_is_refused_with_the_pair_and_the_remedy(tmp_path):
    path = bag(
        tmp_path / "a.bag",
        contacts_message([contact(80.0, "penalty")], 1.0, {(HAND, WALL): 95.0}),
        contacts_message([contact(400.0, "rigid"), contact(300.0, "rigid")], 1.01),
    )
    pairs = contact_record.read(path, float)
    assert [(pair.kind, pair.peak_force) for pair in pairs] == [("rigid", 700.0)]
    with pytest.raises(
        RigidForceError, match=r"panda::panda_hand on wall::link \(rigid contact\) cannot be assessed.*contact: penalty"
    ):
        contact_record.assessable(pairs)


def test_a_force_of_which_nothing_is_said_is_refused_too(tmp_path):
    message = ContactsState()
    message.header.stamp = to_time(1.0)
    state = ContactState(info=f"{HAND} on {WALL}", collision1_name=HAND, collision2_name=WALL)
    state.total_wrench = Wrench()
    state.total_wrench.force.x = -5.0
    message.states.append(state)
    (pair,) = contact_record.read(bag(tmp_path / "a.bag", message), float)
    assert (pair.kind, pair.peak_force) == ("unknown", 5.0)
    with pytest.raises(RigidForceError, match="the kind of contact is not known"):
        contact_record.assessable([pair])


@pytest.mark.parametrize("kind", ["rigid", "penalty"])
def test_metrics_report_and_page_have_the_kind(tmp_path, kind):
    peaks = {(HAND, WALL): 152.34} if kind == "penalty" else {}
    messages = [contacts_message([contact(80.0, kind)], 1.0, peaks)]
    folder = write_run(tmp_path, extra=[("/sim/contacts", message, 1.0) for message in messages])
    result = analyse(folder, figures=False)
    (pair,) = result["contacts"]
    assert (pair["kind"], pair["peak_force"]) == (kind, 152.34 if kind == "penalty" else 80.0)
    (line,) = [line for line in result["report"].splitlines() if line.startswith(HAND)]
    assert kind in line
    assert ("must not be assessed" in result["report"]) == (kind == "rigid")


def test_a_run_without_contact_has_none(tmp_path):
    assert analyse(write_run(tmp_path), figures=False)["contacts"] is None
