"""Gymnasium environment of a collaboration: the unmodified simulation, with a policy in place of the setpoints."""

import logging
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from franka_hw_interface.model import FrankaFrame
from franka_sim.franka_hw_sim import FrankaHWSim
from hric_core.errors import HricError, check_known
from hric_core.geometry import FloatArray
from hric_gym.actions import MODES, ActionMode
from hric_gym.goals import DrawnGoal, Goal, HandGoal, SetpointGoal
from hric_gym.guided import TARGETS
from hric_gym.judge import TRUNK, Costs, Judge
from hric_gym.picture import Renderer
from hric_gym.spaces import Box, Env, Values, arm_fields, as_values, dict_space, person_fields, unit_box
from hric_gym.tasks import (
    DRAWN,
    DRAWS,
    HAND,
    POSTURE,
    TASKS,
    PersonChoice,
    checked_step,
    checked_weights,
    drawn_body,
    scene,
)
from hric_human.control.inverse_kinematics import OutOfReachError
from hric_human.participant.settings import HumanSettings
from hric_run.definition.parameters import HUMAN
from hric_run.simulation import Simulation

STEP = 0.04
"""Robot time between two actions, unless the argument `step` is given [s] (project default)."""
HAND_SPEED = 1.0
"""Velocity of the target of the person's hand for an action of 1, with person="policy" [m/s] (project default)."""
HAND_LEAD = 0.15
"""Largest distance of the target of the person's hand from the hand, per axis [m] (project default)."""
LARGEST = 10.0
"""Largest share of a limit that a cost has in reward and observation [1]; larger shares count as this."""
REFLEX_COST = 20.0
"""Amount by which a reflex of the control box reduces the reward [1] (project default). Without it, an episode that
ends by a reflex would have a higher score than one that continues."""
WEIGHTS = {"force": 0.1, "effort": 0.1}
"""Weights in the reward, by cost, unless the argument `weights` is given (project default)."""

# Reflexes are in `info`; without a handler, Python would print each of them.
logging.getLogger("hric").addHandler(logging.NullHandler())


class CollaborationEnv(Env):
    """Environment of one task: arm, control box and person, with one action per step.

    Each step runs `step` / 1 ms control cycles: the action is sent to a controller, whose command passes through the
    emulated control box. A reflex of the box ends the episode; `info["reflex"]` names the errors of the arm.

    The reward is -distance from the goal [m], minus the weighted costs, each as share of its limit, and minus
    REFLEX_COST for a reflex. `info` has `distance` [m], `success`, `reflex`, the fields of `judge.Costs` (`costs`: its
    shares), and `cost`: the number of constraints of the task that are violated or not known.

    Args:
        task: name of a task, one of `tasks.TASKS`.
        action: name of an action mode, one of `actions.MODES`.
        person, trial, population, drive: person next to the arm, see `tasks.PersonChoice` (person: its `kind`).
        step: robot time between two actions, a multiple of 1 ms, at most 1 s [s].
        weights: weights of the costs in the reward, by name (one of `tasks.COSTS`); None: WEIGHTS.
        changes: overrides of the experiment, `key:=value`: of robot, person, and the controller of the action mode.
        render_mode: "rgb_array", or None: without pictures.

    Raises:
        HricError: a name does not exist, or the task cannot run with these arguments.
    """

    period: float
    """Robot time between two actions [s]."""
    metadata: Mapping[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 1.0 / STEP}

    def __init__(
        self,
        task: str = "Reach",
        action: str = "joint_velocity",
        *,
        person: str = "scripted",
        trial: str = "",
        population: str = "",
        drive: str = "torque",
        step: float = STEP,
        weights: Mapping[str, float] | None = None,
        changes: Sequence[str] = (),
        render_mode: str | None = None,
    ) -> None:
        check_known("task", [task], TASKS)
        check_known("action", [action], MODES)
        check_known("render_mode", [] if render_mode is None else [render_mode], self.metadata["render_modes"])
        self.task, self._choice = TASKS[task], PersonChoice(person, trial, population, drive)
        self._weights, self.render_mode = checked_weights(WEIGHTS if weights is None else weights), render_mode
        self._mode_class, self.period = MODES[action], checked_step(step)
        self.metadata = {**self.metadata, "render_fps": 1.0 / self.period}
        self._limit, self._steps = round(self.task.seconds / self.period), 0
        mode = self._mode_class
        self._scene = scene(self.task, self._choice, mode.controller, mode.parameters, changes)
        mode.check(self._scene.definition.parameters[mode.controller])
        self._renderer: Renderer | None = None
        self._simulation: Simulation | None = None
        self._open(Simulation(self._scene.definition))
        observation = self.simulation.observe()
        if self._weights.get(POSTURE) and observation.person and TRUNK not in observation.person.joints:
            raise HricError("weights.posture: the posture of a person without a trunk is not known; valid: 0")
        self._mode.start(observation)
        self._observation, self._ended = observation, True
        self._restart_goals(np.random.default_rng(0), 0)
        self.action_space = unit_box(*self._mode.space.shape)  # with a random generator of its own
        self.observation_space = dict_space(self._values(Costs()))

    def _open(self, simulation: Simulation) -> None:
        """Replace the simulation by a new one. Raises HricError if its robot is not a Franka arm at the origin."""
        self.close()
        self._simulation, hw = simulation, simulation.app.hw
        if not isinstance(hw, FrankaHWSim):
            raise HricError(f"robot.hw is {simulation.app.name}; valid in hric_gym: franka_sim/FrankaHWSim")
        if not np.allclose(hw.plant.link_state(f"{hw.arm_id}_link0")[0], np.eye(4), atol=1e-9):
            raise HricError(
                "the base of the arm must be at the world's origin; valid: robot.description without xyz, rpy"
            )
        self._hw, self._q_start, self._cycles = hw, np.array(hw.q_start), round(self.period / hw.period)
        if abs(self._cycles * hw.period - self.period) > 1e-9:
            raise HricError(f"step is {self.period}; valid: a multiple of the control cycle, {hw.period} s")
        human = simulation.definition.human
        self._judge = None if human is None else Judge(hw, HumanSettings.of(human, HUMAN))
        self._mode: ActionMode = self._mode_class(simulation)
        self._intended = None if self._scene.intention is None else HandGoal(self._scene.intention, hw.period)
        self.goal = self._goal(hw)

    def _goal(self, hw: FrankaHWSim) -> Goal:
        if self.task.goal == DRAWN:
            return DrawnGoal(hw)
        if self.task.goal == HAND:
            assert self._intended is not None, "a scene without it is refused"
            return self._intended
        return SetpointGoal(self._scene.setpoints, lambda q: hw.model.pose(FrankaFrame.END_EFFECTOR, q)[:3, 3])

    @property
    def simulation(self) -> Simulation:
        """Simulation of the present episode. Raises HricError after `close`."""
        if self._simulation is None:
            raise HricError("the environment is closed; make a new one")
        return self._simulation

    def hand_goal(self) -> FloatArray:
        """Return the position at which the person wants their hand to be, shape (3,) [m]."""
        if self._intended is None:
            raise HricError(f"hand_goal is not defined with person={self._choice.kind!r}; valid: scripted, policy")
        return self._intended.at(self._observation.time)

    @property
    def person_space(self) -> Box:
        """Space of the person's action, with person="policy": velocity of the hand's target, world axes, shape (3,)."""
        return unit_box(3)

    # -- episodes ------------------------------------------------------------------------------------------------------

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Values, dict[str, Any]]:
        """Begin an episode; return the observation and `info`.

        Args:
            seed: seed of all random numbers of this and the following episodes; None: continue the present sequence.
            options: none are valid.

        Raises:
            HricError: an option is given, or the person cannot reach the points of the task in any of DRAWS draws. In
                the second case, no episode is running.
        """
        if options:
            raise HricError(
                f"options {', '.join(map(str, options if isinstance(options, Mapping) else [options]))} are not known; "
                "valid: none"
            )
        super().reset(seed=seed)
        random, self._ended = self.np_random, True
        seed = self._begin(random)
        self._observation, self._steps = self.simulation.observe(), 0
        self._restart_goals(random, seed)
        if self._judge is not None:
            self._judge.restart()
        self._mode.start(self._observation)
        costs, self._ended = Costs(), False
        return self._values(costs), self._info(costs)

    def _restart_goals(self, random: np.random.Generator, seed: int) -> None:
        self.goal.restart(random, seed, self._observation)
        if self._intended is not None:
            self._intended.restart(random, seed, self._observation)

    def _begin(self, random: np.random.Generator) -> int:
        """Begin an episode in which the person can reach the points of the task; return its seed."""
        for _ in range(DRAWS):
            seed, deviation = int(random.integers(2**31)), random.uniform(-1.0, 1.0, 7) * self.task.deviation
            try:
                if self._choice.population:
                    self._open(
                        Simulation(drawn_body(self._scene.definition, self._choice.population, random), seed=seed)
                    )
                self._mode.prepare()
                self.simulation.reset(in_place=True, seed=seed, q_start=(self._q_start + deviation).tolist())
            except OutOfReachError:
                continue
            return seed
        raise HricError(
            f"the person cannot reach the points of the task in any of {DRAWS} draws of body and motion; "
            "valid: points nearer to the person (argument changes)"
        )

    def step(self, action: Any) -> tuple[Values, float, bool, bool, dict[str, Any]]:
        """Execute an action; return observation, reward, terminated, truncated and `info`.

        An episode is truncated after the time of the task, whatever `step` is.

        Args:
            action: numbers from -1 to 1, of the shape of `action_space`; numbers outside are clipped.

        Raises:
            HricError: the episode has ended, a number is not finite, or the simulation failed.
        """
        return self.step_with(action, None)

    def step_with(self, action: Any, hand: Any) -> tuple[Values, float, bool, bool, dict[str, Any]]:
        """Execute an action of the robot and, with person="policy", one of the person; see `step`.

        Args:
            action: numbers from -1 to 1 of the robot.
            hand: 3 numbers from -1 to 1 that move the target of the person's hand; None: the target does not move.
        """
        if self._ended:
            raise HricError("no episode is running: it has ended, or none has begun; call reset() first")
        checked = _checked(action, self.action_space)
        costs = self._advance(checked, None if hand is None else _checked(hand, self.person_space))
        info = self._info(costs)
        reward = -info["distance"] - sum(
            weight * min(costs.shares.get(name, 0.0), LARGEST) for name, weight in self._weights.items()
        )
        if info["reflex"]:
            reward -= REFLEX_COST
        self._ended, self._steps = bool(self._hw.error) or info["success"], self._steps + 1
        late = self._steps >= self._limit and not self._ended
        return self._values(costs), float(reward), self._ended, late, info

    def _advance(self, action: FloatArray, hand: FloatArray | None) -> Costs:
        """Run the cycles of a step; commands are sent, and costs are computed, at its start and every STEP [s]."""
        parts: list[Costs] = []
        left, longest = self._cycles, round(STEP / self._hw.period)
        while left:
            cycles = min(left, longest)
            period = self.period * cycles / self._cycles
            if not parts or not self._mode.whole:
                self._mode.apply(action, self._observation, self.period if self._mode.whole else period)
            if hand is not None:
                self._guide(hand, period)
            self.simulation.advance(cycles)
            self._observation, left = self.simulation.observe(), left - cycles
            parts.append(Costs() if self._judge is None else self._judge.costs(self._observation))
        return Costs.worst(parts)

    def _guide(self, hand: FloatArray, period: float) -> None:
        """Move the target of the person's hand for a period [s], at most HAND_LEAD [m] from the hand on each axis."""
        channel, person = self._scene.channel, self._observation.person
        if not channel or person is None:
            raise HricError(f"the person is {self._choice.kind!r} and cannot be guided; valid: person='policy'")
        present = person.T_world_hand[:3, 3]
        target = TARGETS[channel] + HAND_SPEED * period * hand
        TARGETS[channel] = np.clip(target, present - HAND_LEAD, present + HAND_LEAD)

    def _values(self, costs: Costs) -> Values:
        observation = self._observation
        fields = {**arm_fields(observation.arm), **person_fields(observation)} | {
            "goal": self.goal.at(observation.time),
            "command": self._mode.command,
        }
        if observation.person is not None:
            fields["force_share"] = [min(costs.shares.get("force", 0.0), LARGEST)]
        return as_values(fields)

    def _info(self, costs: Costs) -> dict[str, Any]:
        distance = self.goal.distance(self._observation)
        reflex = sorted(self._hw.robot_state.last_motion_errors) if self._hw.error else []
        return {
            "distance": distance,
            "success": distance < self.goal.near,
            "reflex": ", ".join(reflex) or self._hw.error,
            "costs": dict(costs.shares),
            "violations": costs.violations,
            "not_known": costs.not_known,
            "findings": costs.findings,
            "cost": float(len({*costs.violations, *costs.not_known} & {*self.task.constraints})),
        }

    def render(self) -> Any:
        """Return a picture of the scene, uint8, shape (480, 640, 3); None if `render_mode` is None.

        Raises:
            HricError: OpenGL is not available.
        """
        if self.render_mode is None:
            return None
        if self._renderer is None:
            self._renderer = Renderer(self._hw, self.simulation.definition)
        return self._renderer.picture(self._observation)

    def __reduce__(self) -> Any:
        """Refuse copies, also by pickle: they would share the simulation. Raises HricError."""
        raise HricError("an environment cannot be copied; valid: a new one with the same arguments")

    def close(self) -> None:
        """Release simulation and renderer; a second call does nothing.

        Raises:
            HricError: a picture was drawn in another thread, which alone can release the renderer.
        """
        renderer, self._renderer = self._renderer, None
        simulation, self._simulation = self._simulation, None
        if simulation is not None:
            simulation.close()
        if renderer is not None:
            renderer.close()


def _checked(action: Any, space: Box) -> FloatArray:
    """Return an action clipped to -1 to 1. Raises HricError for a wrong shape, or numbers not real or not finite."""
    try:
        values = np.ma.filled(action, np.nan)  # an array; a masked number is not known
    except (TypeError, ValueError):
        values = np.array(np.nan)
    if values.dtype.kind not in "fiu" or values.shape != space.shape or not all(map(math.isfinite, values.tolist())):
        raise HricError(
            f"the action is {action}; valid: {space.shape[0]} finite numbers from -1 to 1, "
            "of a type that NumPy reads as float or integer"
        )
    return values.astype(np.float64).clip(-1.0, 1.0)
