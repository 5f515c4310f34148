import numpy as np
import pytest

from franka_hw_interface.interfaces import (
    FrankaModelInterface,
    FrankaPoseCartesianInterface,
    FrankaStateInterface,
    FrankaVelocityCartesianInterface,
)
from franka_hw_interface.limits import franka_limits
from franka_hw_interface.model import FrankaFrame, FrankaModelHandle
from franka_hw_interface.robot_state import (
    ERROR_NAMES,
    FIELD_NAMES,
    NO_ERRORS,
    RobotMode,
    RobotState,
    errors,
    identity16,
    lazy_field,
)
from franka_hw_interface.transforms import check_pose, check_transform, column_major
from franka_msgs.msg import Errors, FrankaState
from hric_core.errors import CommandError, HricError, UnknownNameError


class CountingModel:
    """Model that counts the calls of its functions."""

    def __init__(self) -> None:
        self.revision, self.calls = 0, []
        self.gravity_list = lambda q: self._note("gravity").tolist()

    def _note(self, *what: object) -> np.ndarray:
        self.calls.append(what)
        return np.zeros(7)

    def mass(self, q):
        return self._note("mass")

    def coriolis(self, q, dq):
        return self._note("coriolis")

    def gravity(self, q, gravity_base=None):
        return self._note("gravity")

    def pose(self, frame, q):
        return self._note("pose", frame)

    def zero_jacobian(self, frame, q):
        return self._note("zero", frame)

    def body_jacobian(self, frame, q):
        return self._note("body", frame)

    def set_load(self, mass, com, inertia):
        self.revision += 1

    def set_ee(self, F_T_EE):
        self.revision += 1

    def set_stiffness_frame(self, EE_T_K):
        self.revision += 1


def test_the_state_has_every_field_of_the_message_in_its_length() -> None:
    message, state = FrankaState(), RobotState()
    assert set(FIELD_NAMES) == set(FrankaState.__slots__) - {"header"}
    for name in FIELD_NAMES:
        ours, theirs = getattr(state, name), getattr(message, name)
        if isinstance(ours, list):
            assert len(ours) == len(theirs), name


def test_the_41_errors_and_the_modes_are_those_of_the_messages() -> None:
    assert tuple(Errors.__slots__) == ERROR_NAMES
    assert len(ERROR_NAMES) == 41
    assert {f"ROBOT_MODE_{mode.name}": mode.value for mode in RobotMode} == {
        name: getattr(FrankaState, name) for name in dir(FrankaState) if name.startswith("ROBOT_MODE_")
    }
    assert errors([]) == NO_ERRORS
    with pytest.raises(UnknownNameError, match=r"no error 'reflex'.*joint_reflex"):
        errors(["reflex"])


def test_a_snapshot_is_not_changed_by_later_cycles() -> None:
    state = RobotState(tick=5)
    state.q[0], state.current_errors = 1.0, errors(["joint_reflex"])
    kept = state.snapshot()
    state.q[0], state.current_errors = 2.0, NO_ERRORS
    assert (kept.q[0], kept.tick, kept.current_errors) == (1.0, 5, {"joint_reflex"})


def test_a_lazy_field_is_computed_when_read_and_once_per_tick() -> None:
    computed = []

    class State(RobotState):
        __slots__ = ("computed_at",)
        elbow = lazy_field("elbow", lambda state: computed.append(state.tick) or [state.q[2], -1.0])

        def __init__(self) -> None:
            self.computed_at: dict[str, int] = {}
            super().__init__()

    state = State()
    for state.tick in (1, 1, 2, 3):
        state.q[2] = 0.1 * state.tick
        if state.tick != 2:
            assert state.elbow == [state.q[2], -1.0]
    assert computed == [1, 3]
    assert type(state.snapshot()) is RobotState
    with pytest.raises(UnknownNameError, match="no field 'ellbow'"):
        lazy_field("ellbow", lambda state: [])


def test_the_model_handle_computes_what_is_read_and_each_value_once_per_tick() -> None:
    model, state = CountingModel(), RobotState()
    handle = FrankaModelHandle("panda_model", model, state)
    for state.tick in (1, 2):
        model.calls.clear()
        for _ in range(2):
            handle.mass(), handle.coriolis(), handle.gravity(), handle.pose(FrankaFrame.FLANGE)
            (
                handle.zero_jacobian(FrankaFrame.JOINT4),
                handle.body_jacobian(FrankaFrame.JOINT4),
                handle.zero_jacobian(FrankaFrame.FLANGE),
            )
        assert len(model.calls) == 7
    state.tick = 3
    model.calls.clear()
    handle.mass()
    assert model.calls == [("mass",)]


def test_a_load_set_within_a_tick_counts_at_once() -> None:
    model, state = CountingModel(), RobotState(tick=1)
    handle = FrankaModelHandle("panda_model", model, state)
    handle.gravity()
    model.set_load(1.0, [0, 0, 0], [0] * 9)
    handle.gravity()
    assert len(model.calls) == 2


def test_what_is_shared_within_a_tick_cannot_be_written() -> None:
    handle = FrankaModelHandle("panda_model", CountingModel(), RobotState())
    with pytest.raises(ValueError, match="read-only"):
        handle.mass()[0] = 1.0


def test_interfaces_offer_one_handle_and_name_it_when_another_is_requested() -> None:
    state = RobotState()
    for interface, name in [
        (FrankaStateInterface("panda", state), "panda_robot"),
        (FrankaModelInterface("panda", CountingModel(), state), "panda_model"),
        (FrankaPoseCartesianInterface("panda", state), "panda_robot"),
        (FrankaVelocityCartesianInterface("panda", state), "panda_robot"),
    ]:
        assert interface.names == (name,)
        assert interface.handle(name).name == name
        with pytest.raises(
            UnknownNameError, match=f"no handle 'left_robot' in {type(interface).__name__}; valid: {name}"
        ):
            interface.handle("left_robot")


def test_state_and_model_claim_nothing_and_cartesian_commands_claim_the_arm() -> None:
    state = RobotState()
    free = [FrankaStateInterface("panda", state), FrankaModelInterface("panda", CountingModel(), state)]
    claiming = [FrankaPoseCartesianInterface("panda", state), FrankaVelocityCartesianInterface("panda", state)]
    for interface in free + claiming:
        interface.handle(interface.names[0])
    assert [interface.claims for interface in free] == [frozenset()] * 2
    assert [interface.claims for interface in claiming] == [frozenset({"panda_robot"})] * 2


def test_bad_construction_is_refused() -> None:
    with pytest.raises(HricError, match="arm_id must be a non-empty string; got ''"):
        FrankaStateInterface("", RobotState())
    with pytest.raises(HricError, match="state must be a RobotState; got dict"):
        FrankaStateInterface("panda", {})
    with pytest.raises(HricError, match="object is no FrankaModel"):
        FrankaModelInterface("panda", object(), RobotState())


def test_a_pose_command_is_taken_whole_or_refused() -> None:
    handle = FrankaPoseCartesianInterface("panda", RobotState()).handle("panda_robot")
    T = identity16()
    T[12:15] = [0.3, 0.0, 0.5]
    handle.set_command(T, [0.1, -1.0])
    for pose, elbow, said in [
        (T[:12], None, "12 values; it needs 16"),
        ([2.0 * value for value in T], None, "last row"),
        ([float("nan")] * 16, None, "not finite"),
        (T, [0.1, 0.5], "elbow must be"),
    ]:
        with pytest.raises(CommandError, match=said):
            handle.set_command(pose, elbow)
    assert handle.command == (T, [0.1, -1.0])
    handle.set_command(T)
    assert handle.command == (T, None)


SPOILT = {
    "a column too long": lambda T: T.__setitem__(2, 1.0001 * T[2]),
    "two columns not at right angles": lambda T: T.__setitem__(slice(4, 8), [0.6, 0.8, 0.0, 0.0]),
    "left-handed": lambda T: T.__setitem__(slice(8, 11), [-value for value in T[8:11]]),
    "a last row": lambda T: T.__setitem__(7, 2e-5),
    "a last element": lambda T: T.__setitem__(15, 1.0001),
    "an infinite position": lambda T: T.__setitem__(13, float("inf")),
    "a NaN in the rotation": lambda T: T.__setitem__(5, float("nan")),
    "one value less": lambda T: T.pop(),
    "a matrix": lambda T: T.__setitem__(slice(None), [[1.0]] * 16),
}


@pytest.mark.parametrize("spoilt", SPOILT)
def test_the_check_of_the_loop_refuses_what_the_thorough_one_refuses_in_the_same_words(spoilt: str) -> None:
    T = column_major(
        np.array([[0.0, -1.0, 0.0, 0.3], [0.0, 0.0, -1.0, 0.1], [1.0, 0.0, 0.0, 0.5], [0.0, 0.0, 0.0, 1.0]])
    )
    check_pose(T, "T")
    SPOILT[spoilt](T)
    said = []
    for check in (check_pose, check_transform):
        with pytest.raises(CommandError) as refusal:
            check(T, "T")
        said.append(str(refusal.value))
    assert said[0] == said[1]


def test_the_two_checks_of_a_pose_agree_up_to_the_border() -> None:
    random, taken = np.random.default_rng(0), 0
    for _ in range(2000):
        q, _ = np.linalg.qr(random.normal(size=(3, 3)))
        T = np.eye(4)
        T[:3, :3] = q + random.normal(size=(3, 3)) * 10.0 ** random.uniform(-7, -4)
        values = column_major(T)
        outcomes = []
        for check in (check_pose, check_transform):
            try:
                check(values, "T")
                outcomes.append(True)
            except CommandError:
                outcomes.append(False)
        taken += outcomes[0]
        assert outcomes[0] == outcomes[1]
    assert 300 < taken < 1700


def test_a_twist_command_is_taken_whole_or_refused() -> None:
    handle = FrankaVelocityCartesianInterface("panda", RobotState()).handle("panda_robot")
    handle.set_command([0.1] * 6)
    for twist in ([0.1] * 5, [float("inf")] * 6):
        with pytest.raises(CommandError, match="six finite numbers"):
            handle.set_command(twist)
    assert handle.command == ([0.1] * 6, None)


def test_column_major_there_and_back() -> None:
    T = np.eye(4)
    T[:3, 3] = [1.0, 2.0, 3.0]
    assert column_major(T)[12:15] == [1.0, 2.0, 3.0]
    assert np.array_equal(check_transform(column_major(T), "T"), T)


def test_limits_are_the_pandas_and_the_margins_are_libfrankas() -> None:
    limits = franka_limits()
    assert limits.lower[3] == -3.0718
    assert limits.upper[3] == -0.0698
    assert limits.effort == (87.0,) * 4 + (12.0,) * 3
    assert (limits.translation.velocity, limits.rotation.velocity, limits.elbow.velocity) == (2.0, 2.5, 2.175)
    margins = limits.with_margins()
    assert margins.velocity[0] == pytest.approx(2.175 - 0.001 - 0.045)
    assert margins.effort_rate[0] == pytest.approx(999.999)
    assert margins.translation.velocity == pytest.approx(2.0 - 0.001 - 0.039)
    assert margins.effort == limits.effort
