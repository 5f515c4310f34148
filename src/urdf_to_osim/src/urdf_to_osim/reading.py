"""OpenSim model that is read back from its file for verification, with arrays in the order of the description."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import opensim

from hric_core.errors import DescriptionError
from hric_core.geometry import FloatArray
from urdf_to_osim import transforms


class Reading:
    """OpenSim model of an .osim file, with its state.

    Args:
        path: .osim file.
        coordinates: paths of the coordinates; all arrays are in this order, shape (n,).
        frames: paths of frames by name.

    Attributes:
        start: default state of the model.

    Raises:
        DescriptionError: OpenSim cannot load or initialise the model.
    """

    def __init__(self, path: Path, coordinates: Sequence[str], frames: dict[str, str]) -> None:
        try:
            self.model = opensim.Model(str(path))
            self.state = self.model.initSystem()
        except RuntimeError as error:
            raise DescriptionError(f"OpenSim cannot use the model: {transforms.message_of(error)}") from error
        self.start = opensim.State(self.state)
        self._coordinates = [opensim.Coordinate.safeDownCast(self.model.getComponent(name)) for name in coordinates]
        self._frames = {
            name: opensim.PhysicalFrame.safeDownCast(self.model.getComponent(frame)) for name, frame in frames.items()
        }
        self._indices = self._find_indices()
        self._solver = opensim.InverseDynamicsSolver(self.model)
        self.forces = {
            force.getName(): force
            for force in map(self.model.updForceSet().get, range(self.model.getForceSet().getSize()))
        }
        self._acting: set[str] = set(self.forces)
        self.only(())
        drives = {name: opensim.CoordinateActuator.safeDownCast(force) for name, force in self.forces.items()}
        self._drives = {name: drive for name, drive in drives.items() if drive is not None}

    def _find_indices(self) -> list[int]:
        """Return the index of each coordinate's speed in Simbody's order, found by setting distinct speeds."""
        for number, coordinate in enumerate(self._coordinates, 1):
            coordinate.setSpeedValue(self.state, float(number))
        values = list(self.state.getU().to_numpy())
        return [values.index(float(number)) for number in range(1, len(self._coordinates) + 1)]

    def only(self, names: Iterable[str]) -> None:
        """Switch on the forces of these names, and switch off all others; gravity always acts."""
        acting = set(names)
        for name in (acting ^ self._acting) & self.forces.keys():
            self.forces[name].setAppliesForce(self.state, name in acting)
        self._acting = acting

    def move(self, x: FloatArray, xd: FloatArray) -> None:
        """Set all coordinates x and speeds xd, shape (n,) each, without enforcing couplers."""
        for coordinate, value, speed in zip(self._coordinates, x, xd, strict=True):
            coordinate.setValue(self.state, float(value), False)
            coordinate.setSpeedValue(self.state, float(speed))
        self.model.realizeVelocity(self.state)

    def frames(self) -> dict[str, FloatArray]:
        """Return the pose of each frame in ground, shape (4, 4) [m]."""
        return {name: transforms.matrix(frame.getTransformInGround(self.state)) for name, frame in self._frames.items()}

    def mass(self) -> FloatArray:
        """Return the mass matrix, shape (n, n) [kg m^2, kg m, kg]."""
        matrix = opensim.Matrix()
        self.model.getMatterSubsystem().calcM(self.state, matrix)
        return np.array(matrix.to_numpy())[np.ix_(self._indices, self._indices)]

    def inverse_dynamics(self, xdd: FloatArray) -> FloatArray:
        """Return the efforts for accelerations xdd in the present state, shape (n,) [N m or N].

        Gravity and the active forces are considered, couplers are not.
        """
        acceleration = opensim.Vector(len(self._indices), 0.0)
        for index, value in zip(self._indices, xdd, strict=True):
            acceleration.set(index, float(value))
        efforts = self._solver.solve(self.state, acceleration)
        return np.array(efforts.to_numpy())[self._indices]

    def accelerations(self) -> FloatArray:
        """Return the accelerations under gravity and the active forces, with couplers, shape (n,)."""
        self.model.realizeAcceleration(self.state)
        return np.array(self.state.getUDot().to_numpy())[self._indices]

    def coupler_errors(self) -> tuple[FloatArray, FloatArray]:
        """Return the position and speed errors of the couplers, each in the order of the constraints."""
        self.model.realizeVelocity(self.state)
        return np.array(self.state.getQErr().to_numpy()), np.array(self.state.getUErr().to_numpy())

    @contextmanager
    def acting(self, names: Iterable[str]) -> Iterator[None]:
        """Switch on only these forces inside the context, and switch off all forces at its end."""
        self.only(names)
        try:
            yield
        finally:
            self.only(())

    def control(self, values: dict[str, float]) -> None:
        """Set the controls of actuators, by actuator name [N m or N]."""
        self.model.realizeVelocity(self.state)
        controls = opensim.Vector(self.model.getNumControls(), 0.0)
        for index, name in enumerate(self._drives):
            controls.set(index, values[name])
        self.model.setControls(self.state, controls)

    def control_limits(self) -> dict[str, tuple[float, float]]:
        """Return (minimum, maximum) of the control of each actuator, by name [N m or N]."""
        return {name: (drive.getMinControl(), drive.getMaxControl()) for name, drive in self._drives.items()}
