"""Access to one OpenSim model and its state by numpy arrays.

All vectors are in the order of OpenSim's multibody tree, which differs from the order of the joints in the robot
description; `OpenSimEngine.index` has the index of each coordinate.
"""

import numpy as np
import opensim

from hric_control.plant import FloatArray
from hric_core.errors import HricError, UnknownNameError
from opensim_ros_control.robot_model import Built
from opensim_ros_control.stages import rate, view

opensim.Logger.setLevelString("Error")

to_vector = opensim.Vector.createFromMat


class OpenSimEngine:
    """OpenSim model after `initSystem`, with its state. nu: number of coordinates; nz: number of other state variables.

    Attributes:
        built: model before `initSystem`, with its description.
        model, system_state: OpenSim's model and state objects.
        index: index of each coordinate in q and u, by its path.
        state_names: paths of OpenSim's state variables, in its order.
        straight: True if dq/dt = u for all coordinates.
        constraints: number of constraint equations, e.g. of mimic joints.
        frames: OpenSim's frames of the links, by "link" (robot) or "model::link".
        actuators: (index, actuator) of the coordinate actuators. They are switched off in `system_state`, since it is
            faster to apply the efforts outside the model.
    """

    def __init__(self, built: Built) -> None:
        self.built = built
        self.model = built.model
        try:
            self.system_state = opensim.State(self.model.initSystem())
        except RuntimeError as error:
            raise HricError(f"OpenSim cannot use the model: {str(error).strip().splitlines()[0]}") from error
        self.matter = self.model.getMatterSubsystem()
        state = self.system_state
        self.nu, self.nz = state.getNU(), state.getNZ()
        self._present: FloatArray | None = None
        self._y, self._efforts = opensim.Vector(2 * self.nu + self.nz, 0.0), opensim.Vector(self.nu, 0.0)
        self._M, self._result = opensim.Matrix(self.nu, self.nu), opensim.Vector(self.nu, 0.0)
        self._y_view, self._efforts_view, self._M_view, self._result_view = map(
            view, (self._y, self._efforts, self._M, self._result)
        )
        self.coordinates = self._coordinates()
        self.index = {path: self._index_of(coordinate) for path, coordinate in self.coordinates.items()}
        self._slots = np.array(self._position_slots()) if state.getNQ() != self.nu else None
        self.straight = self._is_straight()
        self.model.realizeAcceleration(state)
        self._acceleration = view(state.getUDot())
        self.constraints = len(self.constraint_jacobian())
        self.frames = {
            name: opensim.Frame.safeDownCast(self.model.getComponent(path)) for name, path in built.frames.items()
        }
        self.actuators = self._actuators()
        for _, actuator in self.actuators:
            actuator.setAppliesForce(state, False)
        self._controls = view(self.model.updDefaultControls())
        self._control_slots = self._find_control_slots()
        self._actuated = [index for index, _ in self.actuators]
        self._direct = self._control_slots == list(range(self.nu)) == self._actuated and len(self._controls) == self.nu
        self.state_names = [self.model.getStateVariableNames().get(i) for i in range(self.model.getNumStateVariables())]

    def _coordinates(self) -> dict[str, opensim.Coordinate]:
        coordinates = self.model.getCoordinateSet()
        return {coordinates.get(i).getAbsolutePathString(): coordinates.get(i) for i in range(coordinates.getSize())}

    def _actuators(self) -> list[tuple[int, opensim.CoordinateActuator]]:
        actuator_set = self.model.getActuators()
        actuators = [
            opensim.CoordinateActuator.safeDownCast(actuator_set.get(i)) for i in range(actuator_set.getSize())
        ]
        return [(self.index[a.getCoordinate().getAbsolutePathString()], a) for a in actuators if a is not None]

    def _find_control_slots(self) -> list[int]:
        """Return the indices of the controls of `actuators` among all controls, in the order of the actuators."""
        actuators, slots, number = self.model.getActuators(), [], 0
        for i in range(actuators.getSize()):
            if opensim.CoordinateActuator.safeDownCast(actuators.get(i)) is not None:
                slots.append(number)
            number += actuators.get(i).numControls()
        return slots

    def set_controls(self, efforts: FloatArray) -> None:
        """Set the model's default controls to efforts, shape (nu,) [N m or N]; only actuated coordinates get theirs.

        States with cached values still have the old ones until their cache is invalidated.
        """
        if self._direct:
            self._controls[:] = efforts
        else:
            self._controls[self._control_slots] = efforts[self._actuated]

    def _index_of(self, coordinate: opensim.Coordinate) -> int:
        state = opensim.State(self.system_state)
        state.setU(opensim.Vector(self.nu, 0.0))
        coordinate.setSpeedValue(state, 1.0)
        return int(np.argmax(state.getU().to_numpy()))

    def _position_slots(self) -> list[int]:
        """Return the index of each coordinate in OpenSim's position vector, which free joints make longer."""
        slots = [0] * self.nu
        for path, coordinate in self.coordinates.items():
            state = opensim.State(self.system_state)
            before = state.getQ().to_numpy().copy()
            coordinate.setValue(state, coordinate.getValue(state) + 0.125, False)
            slots[self.index[path]] = int(np.argmax(np.abs(state.getQ().to_numpy() - before)))
        return slots

    def _is_straight(self) -> bool:
        state = opensim.State(self.system_state)
        random = np.random.default_rng(0)
        q, u = random.uniform(0.2, 1.0, self.nu), random.uniform(0.2, 1.0, self.nu)
        state.setQ(to_vector(self._slotted(q)))
        state.setU(to_vector(u))
        self.model.realizeVelocity(state)
        return bool(np.array_equal(self.positions(state.getQDot()), u))

    def _slotted(self, q: FloatArray) -> FloatArray:
        """Return positions, shape (nu,), in the layout of OpenSim's position vector."""
        if self._slots is None:
            return q
        full = np.zeros(self.system_state.getNQ())
        full[self._slots] = q
        return full

    def positions(self, vector: opensim.Vector) -> FloatArray:
        """Return OpenSim's position vector, or its time derivative, as one number per coordinate, shape (nu,)."""
        values = vector.to_numpy()
        return np.asarray(values if self._slots is None else values[self._slots])

    # -- the state -----------------------------------------------------------------------------------------------------

    def put(self, q: FloatArray, u: FloatArray) -> None:
        """Set positions q and speeds u, shape (nu,) each."""
        self._present = None
        self.system_state.setQ(to_vector(self._slotted(q)))
        self.system_state.setU(to_vector(u))

    def put_y(self, y: FloatArray) -> None:
        """Set all integrated variables: positions q, speeds u, other states z, shape (2 nu + nz,).

        If y is the same array object as in the last call, nothing is set and OpenSim's cached results stay valid; so
        the caller must not write into an array after passing it.
        """
        if y is self._present:
            return
        if self._slots is None:
            self._y_view[:] = y
            self.system_state.setY(self._y)
        else:
            n = self.nu
            self.put(y[:n], y[n : 2 * n])
            if self.nz:
                self.system_state.setZ(to_vector(y[2 * n :]))
        self._present = y

    def q(self) -> FloatArray:
        """Return the positions of the state, shape (nu,) [rad or m]."""
        return self.positions(self.system_state.getQ())

    def u(self) -> FloatArray:
        """Return the speeds of the state, shape (nu,) [rad/s or m/s]."""
        return np.asarray(self.system_state.getU().to_numpy())

    def y_view(self, state: opensim.State) -> FloatArray | None:
        """Return a view of a state's integrated variables in OpenSim's memory; None if the layout differs."""
        return view(state.getY()) if self._slots is None else None

    def y_of(self, state: opensim.State) -> FloatArray:
        """Return a copy of all integrated variables of a state of this model, in the layout of `put_y`."""
        held = self.y_view(state)
        if held is not None:
            return held.copy()
        parts = [self.positions(state.getQ()), state.getU().to_numpy()]
        return np.concatenate([*parts, state.getZ().to_numpy()] if self.nz else parts)

    def continue_from(self, before: "OpenSimEngine") -> None:
        """Copy time and values of all state variables that the previous model also has."""
        state = self.system_state
        state.setTime(before.system_state.getTime())
        values = dict(zip(self.state_names, self.state_values(), strict=True))
        values |= zip(before.state_names, before.state_values(), strict=True)
        self._present = None
        self.model.setStateVariableValues(state, to_vector(np.array([values[name] for name in self.state_names])))

    def state_values(self) -> list[float]:
        """Return the values of all state variables, in the order of `state_names`."""
        values: list[float] = self.model.getStateVariableValues(self.system_state).to_numpy().tolist()
        return values

    # -- results of the model ------------------------------------------------------------------------------------------

    def acceleration(self) -> FloatArray:
        """Return du/dt of the OpenSim model alone, without rotors and external efforts, shape (nu,).

        The next call overwrites the array.
        """
        self.model.realizeAcceleration(self.system_state)
        return self._acceleration

    def mass_matrix(self) -> FloatArray:
        """Return the mass matrix without rotors, shape (nu, nu) [kg m^2]; positions must be realized.

        The next call overwrites the array.
        """
        self.matter.calcM(self.system_state, self._M)
        return self._M_view

    def divided_by_mass(self, efforts: FloatArray) -> FloatArray:
        """Return the inverse mass matrix times efforts, shape (nu,); the acceleration must be realized.

        The next call overwrites the array.
        """
        self._efforts_view[:] = efforts
        self.matter.multiplyByMInv(self.system_state, self._efforts, self._result)
        return self._result_view

    def constraint_jacobian(self) -> FloatArray:
        """Return the Jacobian G of the constraints, shape (constraints, nu); velocities must be realized."""
        matrix = opensim.Matrix()
        self.matter.calcG(self.system_state, matrix)
        return np.asarray(matrix.to_numpy())

    def velocity_at(self, q: FloatArray, u: FloatArray) -> FloatArray:
        """Set positions q and speeds u, and return dq/dt for them, shape (nu,)."""
        self.put(q, u)
        self.model.realizeVelocity(self.system_state)
        return self.positions(self.system_state.getQDot())

    def rate(self, y: FloatArray, acceleration: FloatArray) -> FloatArray:
        """Return dy/dt, shape (2 nu + nz,), for a given du/dt in the last realized state y."""
        result = rate(y, acceleration)
        if not self.straight:
            result[: self.nu] = self.positions(self.system_state.getQDot())
        if self.nz:
            result[2 * self.nu :] = self.z_rate()
        return result

    def z_rate(self) -> FloatArray:
        """Return the time derivative of the other states z, shape (nz,); the acceleration must be realized."""
        return np.asarray(self.system_state.getZDot().to_numpy())

    def frame(self, name: str) -> opensim.Frame:
        """Return OpenSim's frame of a link, by "link" (robot) or "model::link".

        Raises:
            UnknownNameError: there is no such link.
        """
        if name not in self.frames:
            raise UnknownNameError("link", name, self.frames, self.model.getName())
        return self.frames[name]
