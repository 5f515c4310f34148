"""Error of a held force: from its reference, the estimate and the contacts in a bag."""

from pathlib import Path
from typing import Any

import pytest
from geometry_msgs.msg import Vector3, Wrench, WrenchStamped
from std_msgs.msg import Header
from synthetic import write_run

from gazebo_msgs.msg import ContactsState, ContactState
from hric_bags.records.contact_record import ForceHeld, forces_held
from hric_core.robot_time import stamps


def wrench(time: float, z: float) -> WrenchStamped:
    header = Header(stamp=stamps.to_time(time), frame_id="panda_link0")
    return WrenchStamped(header=header, wrench=Wrench(force=Vector3(0.0, 0.0, z)))


def contact(time: float, first: str, second: str, z: float) -> ContactsState:
    state = ContactState(collision1_name=first, collision2_name=second)
    state.total_wrench.force.z = z
    return ContactsState(header=Header(stamp=stamps.to_time(time)), states=[state])


def bag(folder: Path, extra: list[tuple[str, Any, float]]) -> Path:
    write_run(folder, extra=extra)
    return next(folder.rglob("*.bag"))


def test_the_error_is_that_along_the_settled_reference_with_either_order_of_the_bodies(tmp_path: Path) -> None:
    extra = []
    for k in range(200):
        time = 1.0 + 0.01 * k
        reference = -10.0 if k >= 50 else 0.0
        extra.append(("/force_controller/reference_force", wrench(time, reference), time))
        extra.append(("/force_controller/measured_force", wrench(time, reference - 0.5), time))
        bodies = ("panda::finger", "table::link", 9.0) if k % 2 else ("table::link", "panda::finger", -9.0)
        extra.append(("/sim/contacts", contact(time, *bodies), time))
    held = forces_held(bag(tmp_path, extra), lambda time: time)
    assert list(held) == ["/force_controller"]
    force = held["/force_controller"]
    assert (force.desired, force.estimate_rms_error, force.contact_rms_error) == pytest.approx((10.0, 0.5, 1.0))
    assert force.seconds == pytest.approx(1.0, abs=0.011)


def test_a_force_that_is_never_held_for_long_enough_and_missing_contacts_are_not_known(tmp_path: Path) -> None:
    short = [("/a/reference_force", wrench(1.0 + 0.01 * k, -10.0), 1.0 + 0.01 * k) for k in range(40)]
    bare = [("/b/reference_force", wrench(1.0 + 0.01 * k, -10.0), 1.0 + 0.01 * k) for k in range(100)]
    bare += [("/b/measured_force", wrench(1.0 + 0.01 * k, -10.0), 1.0 + 0.01 * k) for k in range(100)]
    held = forces_held(bag(tmp_path, short + bare), lambda time: time)
    assert held == {"/b": ForceHeld(10.0, pytest.approx(0.5, abs=0.011), 0.0, None)}
