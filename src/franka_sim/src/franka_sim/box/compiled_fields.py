"""Compiled kinematic fields of the robot state (poses, twists, wrenches), all computed in one call.

`BoxState` computes each field in Python when it is first read. A network client gets all fields in every state; one by
one they would take longer than the rest of the cycle.
"""

import struct
from array import array
from collections.abc import Callable, Sequence
from itertools import accumulate, chain
from operator import attrgetter

from franka_hw_interface.robot_state import RobotState
from franka_sim.box.state import CARTESIAN, ELBOW_FLIP, BoxState
from hric_core.geometry import FloatArray
from hric_core.native import load

_fields: Callable[[bytes, bytearray], None] = load("hric_arm").fields
_numbers: Callable[..., bytes] = load("hric_arm").numbers
_Sizes = dict[str, int]
_EACH_CYCLE: _Sizes = {
    **dict.fromkeys(("q", "q_d", "dq", "dq_d", "ddq_d", "tau_J", "tau_before", "tau_J_d"), 7),
    **{"tau_ext_hat_filtered": 7, "joint_collision": 7},
    **{"cartesian_collision": 6, "dq_before": 7, "generated": 1},
}
_CONFIGURED: _Sizes = {
    **dict.fromkeys(("period", "min_singular_value", "elbow_flip"), 1),
    **{"torques": 7, "forces": 6, "torques_acceleration": 7, "forces_acceleration": 6},
    **dict.fromkeys(("F_T_EE", "EE_T_K", "F_T_NE", "NE_T_EE"), 16),
    **{"m_ee": 1, "F_x_Cee": 3, "I_ee": 9, "m_load": 1, "F_x_Cload": 3, "I_load": 9, "O_ddP_O": 3},
}
_COMPUTED: _Sizes = {
    **{"O_T_EE": 16, "O_F_ext_hat_K": 6, "K_F_ext_hat_K": 6, "joint_contact": 7, "cartesian_contact": 6},
    **{"dtau_J": 7, "elbow": 2},
}
_DESIRED: _Sizes = {"O_T_EE_d": 16, "O_T_EE_c": 16, "O_dP_EE_d": 6, "elbow_d": 2, "elbow_c": 2}
"""Computed unless a Cartesian generator writes them."""
_COMMANDED: _Sizes = {"O_dP_EE_c": 6, "O_ddP_EE_c": 6, "delbow_c": 2, "ddelbow_c": 2}
"""Zero unless a Cartesian generator writes them."""
_NOISE: _Sizes = {"wrench_noise": 6}
"""Zero without sensor noise."""
_SENSORS: _Sizes = {"accelerometers": 2 * 6 * 12}
"""Poses of accelerometers in links 0 to 5, top then bottom: rotation by rows, then position; zero if there are none."""
_SENSED: _Sizes = {"accelerometer_top": 6 * 3, "accelerometer_bottom": 6 * 3}
_LAYOUT: _Sizes = {
    **{**_EACH_CYCLE, **_CONFIGURED, **_COMPUTED, **_DESIRED, **_COMMANDED, **_NOISE},
    **{**_SENSORS, **_SENSED},
}
_SAME = {"theta": "q", "dtheta": "dq"}
_OFFSETS = {name: end - size for (name, size), end in zip(_LAYOUT.items(), accumulate(_LAYOUT.values()), strict=True)}
"""Offset of each member in the doubles of the C struct Fields."""


def _block(sizes: _Sizes) -> struct.Struct:
    return struct.Struct(f"{sum(sizes.values())}d")


_TICK_BLOCK, _CONFIGURATION_BLOCK, _NOISE_BLOCK = _block(_EACH_CYCLE), _block(_CONFIGURED), _block(_NOISE)
_RESULTS: _Sizes = {**_COMPUTED, **_DESIRED}
_RESULT_BLOCK, _RESULT_AT = _block(_RESULTS), 8 * _OFFSETS["O_T_EE"]
_GENERATOR: _Sizes = {**_DESIRED, **_COMMANDED}
_GENERATOR_BLOCK, _GENERATOR_AT = _block(_GENERATOR), 8 * _OFFSETS["O_T_EE_d"]
_generator_fields = attrgetter(*_GENERATOR)
_SLICES = {
    name: slice(_OFFSETS[name] - _RESULT_AT // 8, _OFFSETS[name] - _RESULT_AT // 8 + size)
    for name, size in _RESULTS.items()
}


class CompiledFields:
    """Compiled computation of O_T_EE, desired pose and twist, elbows, external wrench, contacts and dtau_J of a state.

    Args:
        arm: arm parameters (`model_library.parameters`).
        min_singular_value: singular value of the stiffness frame's Jacobian below which the wrench is zero, as in
            the real box.
        accelerometers: poses of the accelerometers on the top, then on the bottom of links 0 to 5, shape (4, 4) each;
            empty: the arm has none.
    """

    def __init__(self, arm: bytes, min_singular_value: float, accelerometers: Sequence[FloatArray] = ()) -> None:
        self._arm = arm
        self._values = bytearray(8 * sum(_LAYOUT.values()))
        poses = [x for T in accelerometers for x in (*T[:3, :3].ravel(), *T[:3, 3])]
        struct.pack_into(f"{len(poses)}d", self._values, 8 * _OFFSETS["accelerometers"], *poses)
        self._min_singular_value = min_singular_value
        self._configuration: tuple[object, ...] = (None, None)

    def _computed(self, state: BoxState) -> tuple[float, ...]:
        """Return the values of _RESULTS, concatenated."""
        self._take(state)
        _fields(self._arm, self._values)
        return _RESULT_BLOCK.unpack_from(self._values, _RESULT_AT)

    def fill(self, state: BoxState) -> None:
        """Compute the kinematic fields of the state's present cycle and store them in the state."""
        values = self._computed(state)
        names = _COMPUTED if state.generator_mode in CARTESIAN else _RESULTS
        for name in names:
            setattr(state, name, [*values[_SLICES[name]]])

    def wrench(self, state: RobotState) -> tuple[list[float], list[float]]:
        """Return O_F_ext_hat_K and K_F_ext_hat_K: 3 forces [N] and 3 moments [N m] each; the state is a BoxState."""
        assert isinstance(state, BoxState)
        values = self._computed(state)
        return [*values[_SLICES["O_F_ext_hat_K"]]], [*values[_SLICES["K_F_ext_hat_K"]]]

    def packer(self, names: Sequence[str], real: str) -> Callable[[BoxState], bytes]:
        """Return a function that packs the numbers of a state for a datagram.

        Args:
            names: fields, in the order of the datagram.
            real: format character of one number in `struct`: "d" (64 bits) or "f" (32 bits).
        """
        members = [_SAME.get(name, name) for name in names]
        offsets = array(
            "i", chain.from_iterable(range(_OFFSETS[name], _OFFSETS[name] + _LAYOUT[name]) for name in members)
        )
        bits = 8 * struct.calcsize(real)

        def pack(state: BoxState) -> bytes:
            self._take(state)
            if state.generator_mode in CARTESIAN:
                _GENERATOR_BLOCK.pack_into(self._values, _GENERATOR_AT, *chain.from_iterable(_generator_fields(state)))
            return _numbers(self._arm, self._values, offsets, bits)

        return pack

    def _take(self, state: BoxState) -> None:
        """Copy the inputs of the computation from the state into the buffer of the C code.

        Configuration values are lists and objects that are replaced as a whole, so their identity shows a change.
        """
        if self._configuration[0] is not state.F_T_EE or self._configuration[1] is not state.thresholds:
            self._take_configuration(state)
        if state.wrench_noise is not None:
            _NOISE_BLOCK.pack_into(self._values, 8 * _OFFSETS["wrench_noise"], *state.wrench_noise)
        _TICK_BLOCK.pack_into(
            self._values,
            0,
            *(
                *state.q,
                *state.q_d,
                *state.dq,
                *state.dq_d,
                *state.ddq_d,
                *state.tau_J,
                *state.tau_before,
                *state.tau_J_d,
            ),
            *(*state.tau_ext_hat_filtered, *state.joint_collision, *state.cartesian_collision, *state.dq_before),
            state.generator_mode in CARTESIAN,
        )

    def _take_configuration(self, state: BoxState) -> None:
        self._configuration = state.F_T_EE, state.thresholds
        t = state.thresholds
        known = {
            **{"period": [state.period], "min_singular_value": [self._min_singular_value], "elbow_flip": [ELBOW_FLIP]},
            **{"torques": t.lower_torque_nominal, "forces": t.lower_force_nominal},
            **{"torques_acceleration": t.lower_torque_acceleration, "forces_acceleration": t.lower_force_acceleration},
            **{"m_ee": [state.m_ee], "m_load": [state.m_load]},
        }
        values = [known.get(name) or getattr(state, name) for name in _CONFIGURED]
        _CONFIGURATION_BLOCK.pack_into(self._values, 8 * _OFFSETS["period"], *chain.from_iterable(values))
