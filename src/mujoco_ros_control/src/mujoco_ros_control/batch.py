"""Many simulations of one robot in one call, on threads, under a control law that is a pure function."""

import copy
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.rollout import Rollout

from hric_control.plant import FloatArray
from hric_control.plants import DivergedError
from hric_core.errors import CommandError, FailureError
from mujoco_ros_control.joints import HELD
from mujoco_ros_control.plant import MujocoPlant

Law = Callable[[float, FloatArray, FloatArray], FloatArray]
"""Control law (time [s], q, dq) -> joint efforts [N m or N], all three shape (runs, joints), q and dq as measured.

It is called once per time step. Row i belongs to run i and may depend only on the time and on row i of q and dq.
"""
_EFFORT = int(mujoco.mjtState.mjSTATE_QFRC_APPLIED)
_STATE = int(mujoco.mjtState.mjSTATE_FULLPHYSICS)


@dataclass(frozen=True)
class Trajectories:
    """Results of a batch of N runs with T steps of a robot with n joints.

    Attributes:
        time: time at the end of each step, shape (T,) [s].
        q: measured joint positions at the end of each step, shape (N, T, n) [rad or m].
        dq: joint velocities at the end of each step, shape (N, T, n) [rad/s or m/s].
        tau: efforts that the law commanded for each step, shape (N, T, n) [N m or N].
    """

    time: FloatArray
    q: FloatArray
    dq: FloatArray
    tau: FloatArray


class MujocoBatch:
    """Batch of runs of one robot in free motion, equal bit for bit to single runs on the plants that it was made of.

    Args:
        plants: one plant per run, in its start state. Each is copied before the next one is requested, so a generator
            can return one plant again and again with another payload or state.
        threads: number of threads; None: as many as this process may use processors.

    Raises:
        CommandError: there is no plant, a plant has something that a batch cannot simulate, or the plants differ in
            more than inertia, friction and state.
    """

    def __init__(self, plants: Iterable[MujocoPlant], threads: int | None = None) -> None:
        self._threads = len(os.sched_getaffinity(0)) if threads is None else threads
        _check_count("threads", self._threads)
        self._models: list[mujoco.MjModel] = []
        starts: list[FloatArray] = []
        copies: dict[bytes, mujoco.MjModel] = {}
        alike: object = None
        for i, plant in enumerate(plants):
            _check(i, plant)
            m, d = plant.world.scene.m, plant.world.scene.d
            kind = (plant.joint_names, plant.config.half_step, m.opt.timestep, m.opt.integrator, m.signature, m.nbuffer)
            if alike not in (None, kind):
                raise CommandError(f"run {i}: its plant has another robot, world, time step or integrator than run 0")
            alike = kind
            image = np.empty(mujoco.mj_sizeModel(m), np.uint8)
            mujoco.mj_saveModel(m, None, image)
            # Equal models are shared, as memory limits the speed of many small ones.
            self._models.append(copies.setdefault(image.tobytes(), copy.copy(m)))
            starts.append(np.concatenate([[0.0], d.qpos, d.qvel]))
        if not starts:
            raise CommandError("a batch needs at least one plant; got none")
        self._plant, self._start, self._threads = plant, np.array(starts), min(self._threads, len(starts))
        self._half, self._step = plant.config.half_step, plant.time_step
        self._columns = 1 + np.array(plant.robot.joints.user)
        self._divergence = plant.robot.joints.divergence(self._step)

    def run(self, law: Law, steps: int) -> Trajectories:
        """Simulate all runs from their start states for a number of time steps.

        Raises:
            CommandError: steps is below 1, or the law does not return finite efforts of shape (runs, joints).
            FailureError: a run has diverged, or contact or a joint stop acts in it.
        """
        _check_count("steps", steps)
        n, runs = len(self._columns), len(self._models)
        q, dq, tau = (np.empty((runs, steps, n)) for _ in range(3))
        state, applied = self._start.copy(), np.zeros((runs, 1, n))
        after, nothing = np.empty((runs, 1, state.shape[1])), np.empty((runs, 1, 0))
        data = [mujoco.MjData(self._models[0]) for _ in range(self._threads)]
        with Rollout(nthread=self._threads if self._threads > 1 else 0) as pool:
            for k in range(steps):
                tau[:, k] = self._efforts(law, k, *self._measured(state))
                applied[:, 0, self._columns - 1] = tau[:, k]
                pool.rollout(
                    self._models, data, state, applied, control_spec=_EFFORT, skip_checks=True, nstep=1,
                    state=after, sensordata=nothing,
                )  # fmt: skip
                if any(d.maxuse_con or d.maxuse_efc for d in data):
                    self._refuse_constraint(k, state, applied)
                state[:] = after[:, 0]
                q[:, k], dq[:, k] = self._measured(state)
                self._check_state(k, state)
        return Trajectories(np.asarray(self._step * np.arange(1, steps + 1), np.float64), q, dq, tau)

    def _measured(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        dq = state[:, self._columns + len(self._columns)]
        return state[:, self._columns] - self._half * dq, dq

    def _efforts(self, law: Law, k: int, q: FloatArray, dq: FloatArray) -> FloatArray:
        result = law(k * self._step, q, dq)
        try:
            tau = np.asarray(result)
        except ValueError:  # lists of different lengths
            tau = np.array(None)
        if tau.shape != q.shape or tau.dtype.kind not in "fiu":
            got = f"{tau.shape} with elements of type {tau.dtype}"
            raise CommandError(f"the law must return efforts of shape {q.shape} (runs, joints), as numbers; got {got}")
        if not np.isfinite(tau).all():
            run, joint = np.argwhere(~np.isfinite(tau))[0]
            name, time = self._plant.joint_names[joint], k * self._step
            raise CommandError(
                f"run {run}: the law's effort of {name} at {time:.3f} s is {tau[run, joint]}, not finite"
            )
        return tau

    def _check_state(self, k: int, state: FloatArray) -> None:
        n, divergence = len(self._columns), self._divergence
        if np.isfinite(state).all() and np.abs(state[:, 1 + n :]).max() <= divergence.quiet:
            return
        for run, row in enumerate(state.tolist()):
            divergence.steps = k
            try:
                divergence.check(row[1 : 1 + n], row[1 + n :])
            except DivergedError as error:
                raise FailureError(f"run {run} of the batch: {error}") from error

    def _refuse_constraint(self, k: int, state: FloatArray, applied: FloatArray) -> None:
        """Find the first run in which a constraint acts in step k, by a repetition of the step run by run."""
        for run, m in enumerate(self._models):
            d = mujoco.MjData(m)
            mujoco.mj_setState(m, d, state[run], _STATE)
            d.qfrc_applied[:] = applied[run, 0]
            mujoco.mj_step(m, d)
            if d.maxuse_con or d.maxuse_efc:
                what = "two shapes come into contact" if d.maxuse_con else "a joint reaches its stop"
                raise FailureError(
                    f"run {run} of the batch: {what} at {k * self._step:.3f} s; a batch simulates free motion only, so "
                    "simulate this run on a single plant"
                )


def _check_count(name: str, value: object) -> None:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise CommandError(f"{name} must be a whole number of at least 1; got {value!r}")


def _check(run: int, plant: MujocoPlant) -> None:
    """Refuse a plant with something that acts from outside MuJoCo's own step, or that needs constraints."""
    world, robot, m = plant.world, plant.robot, plant.world.scene.m
    obstacles = {
        "joints without transmission or mimic joints": len(robot.names) != len(plant.joint_names),
        "models with joints or free objects": m.nq != len(robot.names) or m.nv != len(robot.names),
        "penalty contact or bushings": world.acts,
        "a wrench on a link": bool(world.wrenches.active),
        "braked or driven joints": bool((m.dof_armature >= HELD).any()),
        "Coulomb friction": bool(m.dof_frictionloss.any()),
        "static friction (breakaway)": any(loss.breakaway for loss in robot.losses),
        "a joint that starts outside its range": bool(robot.stops.waiting),
    }
    for what, present in obstacles.items():
        if present:
            raise CommandError(f"run {run}: its plant has {what}, which a batch cannot simulate; use a single plant")
