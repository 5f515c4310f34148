"""Bytes: each field at the place where libfranka looks for it."""

import inspect
import re
import struct
from dataclasses import astuple
from pathlib import Path

import pytest
from fci_peer import command

from franka_hw_interface.robot_state import ERROR_NAMES, RobotMode
from franka_sim import box
from franka_sim.box.rate_limits import CARTESIAN_ERRORS, CARTESIAN_JOINT_ERRORS, JOINT_ERRORS
from franka_sim.box.requests import ControllerMode, GeneratorMode, MotionCommand, RequestOutcome
from franka_sim.fci.device import DeviceState
from franka_sim.fci.protocol import PROTOCOL_5 as V5
from franka_sim.fci.protocol import PROTOCOL_10 as V10
from franka_sim.fci.protocol import FciRequest, Protocol
from franka_sim.fci.wire import WIRE_ERRORS, error_bytes

# field: (numbers, offset in protocol 5, offset in protocol 10), from libfranka's public headers
OFFSETS = {
    "O_T_EE": (16, 8, 8),
    "O_T_EE_d": (16, 136, 72),
    "F_T_EE": (16, 264, 136),
    "EE_T_K": (16, 392, 200),
    "F_T_NE": (16, 520, 264),
    "NE_T_EE": (16, 648, 328),
    "m_ee": (0, 776, 392),
    "I_ee": (9, 784, 396),
    "F_x_Cee": (3, 856, 432),
    "m_load": (0, 880, 444),
    "I_load": (9, 888, 448),
    "F_x_Cload": (3, 960, 484),
    "elbow": (2, 984, 496),
    "elbow_d": (2, 1000, 504),
    "tau_J": (7, 1016, 512),
    "tau_J_d": (7, 1072, 540),
    "dtau_J": (7, 1128, 568),
    "q": (7, 1184, 596),
    "q_d": (7, 1240, 624),
    "dq": (7, 1296, 652),
    "dq_d": (7, 1352, 680),
    "ddq_d": (7, 1408, 708),
    "joint_contact": (7, 1464, 736),
    "cartesian_contact": (6, 1520, 764),
    "joint_collision": (7, 1568, 788),
    "cartesian_collision": (6, 1624, 816),
    "tau_ext_hat_filtered": (7, 1672, 840),
    "O_F_ext_hat_K": (6, 1728, 868),
    "K_F_ext_hat_K": (6, 1776, 892),
    "O_dP_EE_d": (6, 1824, 916),
    "O_ddP_O": (3, 1872, 940),
    "elbow_c": (2, 1896, 952),
    "delbow_c": (2, 1912, 960),
    "ddelbow_c": (2, 1928, 968),
    "O_T_EE_c": (16, 1944, 976),
    "O_dP_EE_c": (6, 2072, 1040),
    "O_ddP_EE_c": (6, 2120, 1064),
    "theta": (7, 2168, 1088),
    "dtheta": (7, 2224, 1116),
}


def patterned() -> DeviceState:
    """Return a state whose numbers are all different and exact in 32 bits."""
    state, n = DeviceState(), 0
    for name, (count, _, _) in OFFSETS.items():
        setattr(state, name, [float(n + i) for i in range(count)] if count else float(n))
        n += count or 1
    return state


@pytest.mark.parametrize("protocol, column, letter", [(V5, 1, "d"), (V10, 2, "f")])
def test_each_field_stands_at_the_place_of_the_public_headers(protocol: Protocol, column: int, letter: str) -> None:
    state = patterned()
    datagram = protocol.state.encode(7, state)
    assert struct.unpack_from("<Q", datagram) == (7,)
    for name, row in OFFSETS.items():
        expected = getattr(state, name)
        got = struct.unpack_from(f"<{row[0] or 1}{letter}", datagram, row[column])
        assert list(got) == (expected if isinstance(expected, list) else [expected]), name


@pytest.mark.parametrize("protocol, size, at", [(V5, 2373, 2280), (V10, 1377, 1288)])
def test_modes_errors_and_success_rate_close_the_state(protocol: Protocol, size: int, at: int) -> None:
    state = DeviceState()
    state.controller_mode, state.generator_mode, state.robot_mode = (
        ControllerMode.EXTERNAL,
        GeneratorMode.CARTESIAN_POSITION,
        RobotMode.REFLEX,
    )
    state.current_errors, state.last_motion_errors = frozenset({WIRE_ERRORS[0]}), frozenset({WIRE_ERRORS[40]})
    state.control_command_success_rate = 0.5
    datagram = protocol.state.encode(1, state)
    assert len(datagram) == protocol.state.size == size
    assert (datagram[at], datagram[at + 1], datagram[at + 84]) == (3, 2, 4)
    assert datagram[at + 2] == 1 and datagram[at + 3 : at + 43] == bytes(40)
    assert datagram[at + 43 : at + 83] == bytes(40) and datagram[at + 83] == 1
    assert struct.unpack("<d" if size == 2373 else "<f", datagram[at + 85 :]) == (0.5,)


def test_the_41_errors_of_the_wire_are_those_of_the_state_each_with_a_byte_of_its_own() -> None:
    assert sorted(WIRE_ERRORS) == sorted(ERROR_NAMES) and len(WIRE_ERRORS) == 41
    for i, name in enumerate(WIRE_ERRORS):
        assert error_bytes({name}) == bytes(i) + b"\x01" + bytes(40 - i)


def test_numbers_too_large_for_32_bits_are_sent_as_the_largest() -> None:
    state = DeviceState()
    state.tau_J[:] = [1e300, -1e300, 1.0, 0.0, 0.0, 0.0, 0.0]
    got = struct.unpack_from("<3f", V10.state.encode(1, state), 512)
    assert got == (3.4028234663852886e38, -3.4028234663852886e38, 1.0)


@pytest.mark.parametrize("protocol, size", [(V5, 370), (V10, 371)])
def test_a_command_comes_out_as_it_went_in(protocol: Protocol, size: int) -> None:
    numbers = iter(float(n) for n in range(100))
    sent = MotionCommand(
        q=[next(numbers) for _ in range(7)],
        dq=[next(numbers) for _ in range(7)],
        O_T_EE=[next(numbers) for _ in range(16)],
        O_dP_EE=[next(numbers) for _ in range(6)],
        elbow=(next(numbers), next(numbers)),
        tau=[next(numbers) for _ in range(7)],
        finished=True,
    )
    datagram = protocol.command.encode(9, sent)
    assert len(datagram) == protocol.command.size == size
    assert struct.unpack_from("<7d", datagram, 8) == tuple(range(7)) and struct.unpack_from(
        "<7d", datagram, 314
    ) == tuple(range(38, 45))
    assert protocol.command.decode(datagram) == (9, sent)


def test_torques_that_are_finished_end_a_motion_of_protocol_10_as_generators_do() -> None:
    plain = V10.command.encode(1, command())
    for place in (313, 370):
        flagged = plain[:place] + b"\x01" + plain[place + 1 :]
        assert V10.command.decode(flagged)[1].finished
    assert not V10.command.decode(plain)[1].finished


def test_requests_have_the_sizes_and_numbers_of_the_public_headers() -> None:
    sizes_v5 = [4, 56, 0, 4, 416, 56, 48, 7, 128, 128, 104, 40, 0, 2]
    sizes_v10 = [4, 113, 0, 416, 56, 48, 7, 128, 128, 104, 0, 0]
    assert [V5.requests[i].payload.size for i in range(14)] == sizes_v5 and len(V5.requests) == 14
    assert [V10.requests[i].payload.size for i in range(12)] == sizes_v10 and len(V10.requests) == 12
    assert V5.requests[12].request is V10.requests[10].request is FciRequest.AUTOMATIC_ERROR_RECOVERY


@pytest.mark.parametrize("protocol", [V5, V10])
def test_every_request_has_a_number_for_every_outcome(protocol: Protocol) -> None:
    for row in protocol.requests.values():
        if row.request is FciRequest.CONNECT:
            continue
        for outcome in RequestOutcome:
            number = protocol.status(row.request, outcome)
            assert (number == 0) == (outcome is RequestOutcome.SUCCESS), f"{row.request} {outcome}"


def test_a_reflex_has_the_number_that_each_protocol_gives_it() -> None:
    assert (
        V5.status(FciRequest.MOVE, RequestOutcome.REFLEX_ABORTED),
        V10.status(FciRequest.MOVE, RequestOutcome.REFLEX_ABORTED),
    ) == (6, 8)
    assert (
        V5.status(FciRequest.MOVE, RequestOutcome.NOT_POSSIBLE),
        V10.status(FciRequest.MOVE, RequestOutcome.NOT_POSSIBLE),
    ) == (3, 5)


def test_the_interface_page_lists_the_errors_that_the_box_never_raises() -> None:
    page = (Path(__file__).parents[1] / "INTERFACE.md").read_text()
    rows = page.partition("the box never raises these ten:")[2].partition("\n## ")[0].splitlines()
    listed = [name for row in rows for name in re.findall(r"`(\w+)`", row.partition(" | ")[0])]
    source = "".join(path.read_text() for path in Path(inspect.getfile(box)).parent.rglob("*.py"))
    rates = {name for errors in (JOINT_ERRORS, CARTESIAN_ERRORS, CARTESIAN_JOINT_ERRORS) for name in astuple(errors)}
    never = {name for name in WIRE_ERRORS if name not in rates and f'"{name}"' not in source}
    assert len(listed) == 10 and set(listed) == never
