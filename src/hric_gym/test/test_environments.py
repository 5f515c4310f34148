"""Environments of Gymnasium and PettingZoo: checkers, bits, reflexes, costs, persons."""

import copy
import hashlib
import json
import pickle
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hric_assessment.contact.limits import Limits
from hric_assessment.separation.capsules import distances
from hric_control.speed_scale import stopping_time
from hric_core.errors import HricError

gymnasium = pytest.importorskip("gymnasium", reason="scripts/setup --with learning")
envs = pytest.importorskip("hric_gym.envs")

from gymnasium.utils.env_checker import check_env  # noqa: E402

from hric_gym import goals  # noqa: E402
from hric_gym.actions import MODES  # noqa: E402
from hric_gym.environment import CollaborationEnv  # noqa: E402
from hric_gym.goals import NEAR, DrawnGoal  # noqa: E402
from hric_gym.judge import Costs  # noqa: E402


def bits(values: dict[str, Any]) -> bytes:
    return b"".join(name.encode() + np.ascontiguousarray(value).tobytes() for name, value in sorted(values.items()))


def played(env: Any, seed: int, steps: int = 12) -> str:
    """Return a hash of all observations and rewards of random actions."""
    random, digest = np.random.default_rng(seed), hashlib.sha256()
    values, _ = env.reset(seed=seed)
    digest.update(bits(values))
    for _ in range(steps):
        values, reward, ended, _, info = env.step(random.uniform(-0.5, 0.5, env.action_space.shape))
        digest.update(bits(values) + repr((reward, ended, info["costs"], info["reflex"])).encode())
        if ended:
            break
    return digest.hexdigest()


@pytest.mark.parametrize(("identity", "drive"), [*((one, "torque") for one in envs.IDS), ("hric/Reach-v0", "muscle")])
def test_gymnasiums_checker_passes(identity: str, drive: str) -> None:
    env = gymnasium.make(identity, drive=drive).unwrapped
    with warnings.catch_warnings():
        warnings.filterwarnings("error")
        warnings.filterwarnings("ignore", message=".*(minimum|maximum) value is (-)?infinity.*")
        warnings.filterwarnings("ignore", message=".*not having a max_episode_steps.*")
        check_env(env, skip_render_check=True)
    env.close()


@pytest.mark.parametrize("identity", list(envs.IDS))
def test_the_checker_of_stable_baselines3_passes(identity: str) -> None:
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    env = gymnasium.make(identity)
    checker.check_env(env, warn=False)
    env.close()


@pytest.mark.parametrize("task", ["Reach", "HandGuidance"])
def test_pettingzoos_test_passes(task: str) -> None:
    testing = pytest.importorskip("pettingzoo.test")
    from hric_gym.parallel import CollaborationParallelEnv

    env = CollaborationParallelEnv(task)
    testing.parallel_api_test(env, num_cycles=60)
    env.close()
    testing.parallel_seed_test(lambda: CollaborationParallelEnv(task), num_cycles=5)


def test_two_agents_act_only_in_an_episode_and_together() -> None:
    pytest.importorskip("pettingzoo")
    from hric_gym.parallel import CollaborationParallelEnv

    with pytest.raises(HricError, match=r"argument person: .* valid: neither person nor trial"):
        CollaborationParallelEnv(person="scripted")
    env = CollaborationParallelEnv("HandGuidance", step=1.0)
    assert env.metadata["render_fps"] == 1.0
    actions = {agent: np.zeros(env.action_space(agent).shape) for agent in env.possible_agents}
    with pytest.raises(HricError, match="no episode is running"):
        env.step(actions)
    env.reset(seed=1)
    with pytest.raises(HricError, match="no action of person; valid: one of each agent, robot, person"):
        env.step({"robot": actions["robot"]})
    with pytest.raises(HricError, match="no action of person; valid: one of each agent, robot, person"):
        env.step({"robot": actions["robot"], "person": None})
    for wrong in (None, list(actions.values())):
        with pytest.raises(HricError, match="no action of robot, person; valid: one of each agent, robot, person"):
            env.step(wrong)
    with pytest.raises(HricError, match="no agent 'human'; valid: person, robot"):
        env.step({**actions, "human": actions["person"]})
    while env.agents:
        env.step(actions)
    with pytest.raises(HricError, match="no episode is running"):
        env.step(actions)
    env.close()


SCRIPT = """
import json, sys
sys.path.insert(0, {folder!r})
from test_environments import played
from hric_gym.environment import CollaborationEnv
env = CollaborationEnv(**json.loads(sys.argv[1]))
print(*(played(env, seed) for seed in (3, 5)))
"""


@pytest.mark.parametrize(
    "settings",
    [
        {"task": "Reach", "action": "joint_velocity"},
        {"task": "Reach", "action": "torque", "person": "none"},
        {"task": "Contact", "action": "joint_position"},
        {"task": "HandGuidance", "action": "impedance", "drive": "muscle"},
        {"task": "Handover", "action": "end_effector"},
        {"task": "Reach", "population": "adult_mixed"},
        {"task": "Reach", "person": "policy"},
    ],
    ids=lambda settings: "-".join(settings.values()),
)
def test_a_seed_gives_the_same_bits_in_another_process_and_after_other_episodes(settings: dict[str, str]) -> None:
    folder = str(Path(__file__).parent)
    command = [sys.executable, "-c", SCRIPT.format(folder=folder), json.dumps(settings)]
    other = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True).stdout.split()
    env = CollaborationEnv(**settings)
    assert [played(env, seed) for seed in (9, 3, 5, 3)][1:] == [*other, other[0]]
    assert other[0] != other[1]
    env.close()


def test_processes_of_gymnasium_give_the_bits_of_one() -> None:
    made = [lambda: gymnasium.make("hric_gym.envs:hric/Reach-v0", person="none") for _ in range(2)]
    vector = gymnasium.vector.AsyncVectorEnv(made, context="spawn")
    values, _ = vector.reset(seed=[3, 4])
    actions = np.full((2, 7), 0.1)
    for _ in range(5):
        values, *_ = vector.step(actions)
    vector.close()
    env = CollaborationEnv("Reach", person="none")
    for index, seed in enumerate((3, 4)):
        env.reset(seed=seed)
        for _ in range(5):
            alone, *_ = env.step(actions[index])
        for name, value in alone.items():
            np.testing.assert_array_equal(value, values[name][index])
    env.close()


@pytest.mark.parametrize("action", list(MODES))
def test_an_action_moves_the_arm_in_its_direction(action: str) -> None:
    env = CollaborationEnv("Reach", action, person="none")
    before, _ = env.reset(seed=1)
    command = np.zeros(env.action_space.shape)
    command[0] = 0.5
    if action == "joint_position":
        q, low, high = before["q"], env._mode._low, env._mode._high
        command = np.clip(2.0 * (q - low) / (high - low) - 1.0, -1.0, 1.0)
        command[0] = 0.3
    for _ in range(15):
        after, _, ended, _, info = env.step(command)
        assert not ended, info["reflex"]
    change = (
        after["ee_position"][0] - before["ee_position"][0]
        if "e" in action[0:1] or action == "impedance"
        else (after["q"][0] - before["q"][0])
    )
    assert change > 0.01
    env.close()


@pytest.mark.parametrize("action", [name for name, mode in MODES.items() if not mode.whole])
def test_a_long_step_moves_the_arm_as_short_ones_with_the_same_action(action: str) -> None:
    ends = []
    for step, steps in ((0.04, 20), (0.4, 2)):
        env = CollaborationEnv("Reach", action, person="none", step=step)
        env.reset(seed=1)
        numbers = np.zeros(env.action_space.shape)
        numbers[0] = 0.02 if action == "torque" else 0.5
        for _ in range(steps):
            values, _, ended, _, info = env.step(numbers)
            assert not ended, info["reflex"]
        ends.append(values["q"])
        env.close()
    np.testing.assert_allclose(*ends, atol=1e-5)


def test_a_reflex_ends_the_episode_and_is_named() -> None:
    env = CollaborationEnv("Contact", "joint_velocity")
    env.reset(seed=1)
    command, ended, info = np.array([1.0, 0, 0, 0, 0, 0, 0]), False, {}
    costs = []
    for _ in range(50):
        if not ended:
            _, _, ended, _, info = env.step(command)
            costs.append(info["costs"]["force"])
    assert ended and "cartesian_reflex" in info["reflex"] and max(costs) > 0.1
    with pytest.raises(HricError, match="no episode is running"):
        env.step(command)
    _, info = env.reset()
    assert info["reflex"] == ""
    env.close()


def test_the_page_has_the_fields_of_observations_and_the_ids() -> None:
    from hric_gym.spaces import FIELDS

    page = (Path(__file__).resolve().parents[1] / "INTERFACE.md").read_text()
    for name, field in FIELDS.items():
        assert f"| `{name}` | {field.shape} | {field.unit} | {field.text} |" in page
    assert all(f"| `{identity}` |" in page for identity in envs.IDS)
    env = CollaborationEnv("Reach", drive="muscle")
    assert set(env.observation_space.spaces) == set(FIELDS)
    env.close()


@pytest.mark.parametrize("action", [name for name in MODES if not name.startswith("joint_")])
def test_tasks_with_setpoints_run_with_controllers_that_their_experiment_does_not_start(action: str) -> None:
    env = CollaborationEnv("Contact", action)
    values, _ = env.reset(seed=1)
    assert np.linalg.norm(values["goal"] - values["ee_position"]) > 0.1
    env.close()


def test_what_does_not_fit_is_refused_with_the_valid_choices() -> None:
    for settings, match in (
        ({"task": "Reaching"}, "CoTransport, Contact, HandGuidance"),
        ({"task": ["Reach"]}, r"no task \['Reach'\]; valid: CoTransport"),
        ({"changes": None}, "changes is None; valid: a list of overrides"),
        ({"changes": [3]}, r"changes is \[3\]; valid: a list of overrides"),
        ({"action": "joints"}, "joint_velocity"),
        ({"person": "actor"}, "none, policy, reactive, scripted, trial"),
        ({"person": "trial"}, "valid: a path with person='trial', else none"),
        ({"task": "Handover", "person": "none"}, "valid: scripted, policy"),
        ({"population": "children"}, "adult_female"),
        ({"step": 0.0015}, "a multiple of 0.001 s"),
        ({"step": 1e9}, "step is 1000000000.0; valid: a finite number above 0 to 1"),
        ({"step": float("nan")}, "step is nan; valid: a finite number above 0 to 1"),
        ({"weights": {"speed": 1.0}}, "effort, force, posture, separation, stopping"),
        ({"weights": {"force": float("nan")}}, "weights.force is nan; valid: a finite number"),
        ({"weights": [1.0]}, "weights is "),
        ({"population": "adult_mixed", "person": "none"}, "population is 'adult_mixed' with person='none'"),
        (
            {"person": "trial", "trial": "walk.csv"},
            r"'walk.csv'; valid: a file with the extension .c3d or .trc or .mot",
        ),
        ({"person": "none", "drive": "muscle"}, "drive is 'muscle' with person='none'; valid: another person"),
        (
            {"task": "Contact", "changes": ["setpoints:=[]"]},
            "contact has no setpoint to use as goal",
        ),
        ({"step": 0.041, "changes": ["robot.plant.time_step:=0.002"]}, "step is 0.041; .* control cycle, 0.002 s"),
        ({"weights": {"posture": 1.0}, "changes": ["human.parts:=right_arm"]}, "weights.posture: .* is not known"),
        ({"changes": "kp:=50"}, "changes is 'kp:=50'; valid: a list of overrides"),
        ({"changes": ["duration:=9"]}, "'duration:=9' has no effect in this environment; valid: keys of human, param"),
        ({"changes": ["arms:=left,right"]}, "'arms:=left,right' has no effect"),
        ({"changes": ["human.drive:=muscle"]}, "valid: the argument drive"),
        ({"changes": ["human.rate:=1"]}, "'human.rate:=1' is not possible; valid: 25 Hz"),
        ({"changes": ["human.subject:=P50_male"], "population": "adult_female"}, "not possible; valid: no population"),
        ({"person": "none", "changes": ["human.mass:=50"]}, "valid: keys of parameters, robot"),
        ({"changes": ["parameters.force_controller.force:=[0, 0, 5]"]}, "not one of joint_pd_controller"),
        (
            {
                "action": "impedance",
                "changes": ["parameters.cartesian_impedance_controller.rotational_stiffness:=7"],
            },
            "rotational_stiffness: 7 has no effect, since each action sets it; valid: .* end_effector",
        ),
    ):
        with pytest.raises(HricError, match=match):
            CollaborationEnv(**settings)
    env = CollaborationEnv("Reach", person="none")
    env.reset(seed=0)
    wrong = [np.full(7, np.nan), np.zeros(6), "left", {}, [0.0] * 6 + [[0.0]]]
    wrong += [np.full(7, 1.0j), np.full(7, "0.1"), np.ones(7, bool), np.ones(7, "timedelta64[s]")]
    wrong += [np.ma.masked_array(np.zeros(7), mask=True)]
    for action in wrong:
        with pytest.raises(HricError, match="valid: 7 finite numbers"):
            env.step(action)
    with pytest.raises(HricError, match="cannot be guided"):
        env.step_with(np.zeros(7), np.zeros(3))
    for options in ({1: 2}, 1):
        with pytest.raises(HricError, match="options 1 are not known; valid: none"):
            env.reset(seed=3, options=options)
    assert env.np_random_seed == 0
    for copied in (copy.deepcopy, pickle.dumps):
        with pytest.raises(HricError, match="an environment cannot be copied; valid: a new one"):
            copied(env)
    env.close()


@pytest.mark.parametrize(
    ("action", "change"),
    [("joint_velocity", "kp:=30"), ("end_effector", "parameters.cartesian_impedance_controller.filter_time:=0.5")],
)
def test_a_change_of_the_controllers_parameters_replaces_that_of_the_action_mode(action: str, change: str) -> None:
    rows = []
    for changes in ([], [change]):
        env = CollaborationEnv("Reach", action, person="none", changes=changes)
        env.reset(seed=1)
        rows.append([env.step(np.full(env.action_space.shape, 0.3))[0]["q"] for _ in range(5)][-1])
        env.close()
    assert np.abs(rows[1] - rows[0]).max() > 1e-3


@pytest.mark.parametrize("change", ["robot.plant.time_step:=0.002", "simulator:=opensim"])
def test_a_step_has_its_duration_with_other_cycles_and_engines(change: str) -> None:
    env = CollaborationEnv("Reach", person="none", changes=[change])
    env.reset(seed=1)
    begin = env.simulation.observe().time
    env.step(np.zeros(7))
    assert env.simulation.observe().time - begin == pytest.approx(0.04)
    env.close()


@pytest.mark.parametrize(("step", "steps"), [(0.04, 100), (0.1, 40), (0.4, 10)])
def test_an_episode_ends_after_the_time_of_the_task_for_any_step(step: float, steps: int) -> None:
    env = gymnasium.make("hric/Reach-v0", person="none", step=step, action="torque")
    env.reset(seed=1)
    assert env.metadata["render_fps"] == pytest.approx(1.0 / step)  # else a video has another duration
    late = [env.step(np.zeros(7))[2:4] for _ in range(steps)]
    assert late == [(False, False)] * (steps - 1) + [(False, True)]
    env.reset()
    assert env.step(np.zeros(7))[2:4] == (False, False)
    env.close()


def test_without_gymnasium_the_error_names_the_command_that_installs_it() -> None:
    lines = "import sys; sys.modules['gymnasium'] = None; import hric_gym.envs"
    done = subprocess.run([sys.executable, "-c", lines], capture_output=True, text=True, timeout=120)
    assert done.returncode == 1 and "scripts/setup --with learning" in done.stderr.splitlines()[-1]


def test_a_guided_hand_goes_where_the_agent_sends_it_and_stays_where_the_arm_ends() -> None:
    env = CollaborationEnv("Reach", person="policy")
    before, _ = env.reset(seed=2)
    for _ in range(20):
        after, *_ = env.step_with(np.zeros(7), np.array([0.0, 0.5, 0.5]))
    moved = after["hand_position"] - before["hand_position"]
    assert moved[1] > 0.05 and moved[2] > 0.05
    for _ in range(60):
        far, _, ended, _, _ = env.step_with(np.zeros(7), np.array([0.0, 1.0, 0.0]))
        assert not ended
    assert np.isfinite(far["hand_position"]).all() and far["hand_position"][1] < before["hand_position"][1] + 0.7
    env.close()


def straight(env: CollaborationEnv, values: dict[str, Any]) -> Any:
    offset = env.goal.at(0.0) - values["ee_position"]
    return 0.3 * offset / np.abs(offset).max()


def test_the_cost_stopping_is_the_way_of_a_stop_towards_the_person_as_share_of_the_distance() -> None:
    """The person does not move in the first half second; the time of a stop is that of the supervisor's defaults."""
    env = CollaborationEnv("Reach", "end_effector_stream")
    before, _ = env.reset(seed=1)
    env.goal._point = np.array([0.43, -0.27, 0.52])  # their left hand
    before, _, _, _, info = env.step(np.zeros(3))
    shares, expected = [info["costs"]["stopping"]], [0.0]
    for _ in range(8):
        after, _, _, _, info = env.step(straight(env, before))
        speed, distance = (before["separation"][0] - after["separation"][0]) / env.period, after["separation"][0]
        shares.append(info["costs"]["stopping"])
        expected.append(speed * (0.1 + 0.5 * stopping_time(1.0) + 0.25) / distance)
        before = after
    env.close()
    assert shares[0] < 0.01 and expected[-1] > 0.3
    ratios = np.divide(shares[-3:], expected[-3:])  # a part that is not the nearest may have the larger share
    assert ratios.min() > 0.95 and ratios.max() < 1.25


@pytest.mark.parametrize("seed", [1, 4, 7])
def test_a_goal_is_drawn_where_the_arm_ends_without_contact(seed: int) -> None:
    """The motion in the simulation, without a person, ends at the computed distance from the person of the draw."""
    env, bare = (CollaborationEnv("Reach", "end_effector_stream", person=person) for person in ("scripted", "none"))
    env.reset(seed=seed)
    assert isinstance(env.goal, DrawnGoal)
    start, computed = env._observation, env.goal.clearance(env._observation)
    values, _ = bare.reset(seed=seed)
    bare.goal, ended = env.goal, False
    while not ended:
        values, _, ended, _, _ = bare.step(straight(bare, values))
    arm, person = bare._observation.arm.capsules, start.person.capsules
    apart = distances(arm.ends[None], arm.radii, person.ends[None], person.radii)
    assert computed >= NEAR and apart.min() == pytest.approx(computed, abs=1.5 * NEAR)
    env.goal._point = start.person.T_world_hand[:3, 3]
    assert env.goal.clearance(start) < 0.0 and bare.goal.clearance(bare._observation) == np.inf
    for each in (env, bare):
        each.close()


LEFT_HAND = np.array([[0.42, -0.29, 0.5], [0.44, -0.25, 0.54]])
"""Box of goals at the person's left hand, world [m]."""


def test_a_person_at_all_goals_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(goals, "BOX", LEFT_HAND)
    with pytest.raises(HricError, match="the person is at all of 100 drawn goals"):
        CollaborationEnv("Reach")


def test_after_a_reset_that_failed_no_episode_is_running(monkeypatch: pytest.MonkeyPatch) -> None:
    env = CollaborationEnv("Reach")
    env.reset(seed=1)
    with monkeypatch.context() as patch:
        patch.setattr(goals, "BOX", LEFT_HAND)
        with pytest.raises(HricError, match="the person is at all"):
            env.reset()
    with pytest.raises(HricError, match="no episode is running"):
        env.step(np.zeros(7))
    env.reset()
    env.step(np.zeros(7))
    env.close()


def test_a_reactive_hand_approaches_the_resting_arm() -> None:
    env = CollaborationEnv("Reach", "end_effector", person="reactive")
    values, _ = env.reset(seed=2)
    distances = []
    for _ in range(60):
        distances.append(np.linalg.norm(values["hand_position"] - values["ee_position"]))
        values, _, ended, _, _ = env.step(np.zeros(6))
        if ended:  # the hand has touched the arm
            break
    assert min(distances) < distances[0] - 0.1
    env.close()


def test_a_recorded_trial_moves_the_person(tmp_path: Path) -> None:
    trial = tmp_path / "elbow.mot"
    rows = "".join(f"{0.01 * k}\t{80.0 + 20.0 * np.sin(0.02 * k)}\n" for k in range(300))
    head = "elbow\nversion=1\nnRows=300\nnColumns=2\ninDegrees=yes\nendheader\ntime\tright_el_flex\n"
    trial.write_text(head + rows)
    env = CollaborationEnv("Reach", person="trial", trial=str(trial))
    values, _ = env.reset(seed=0)
    person = env.simulation.observe().person
    assert person is not None
    elbow = person.joints.index("right_el_flex")
    for _ in range(30):
        values, *_ = env.step(np.zeros(7))
    assert abs(np.degrees(values["person_q"][elbow]) - 80.0 - 20.0 * np.sin(0.02 * 120)) < 8.0
    env.close()


def test_each_episode_has_another_body_of_the_population() -> None:
    env = CollaborationEnv("Reach", population="adult_mixed")
    bodies = []
    for seed in (1, 2, 1):
        env.reset(seed=seed)
        human = env.simulation.definition.human
        assert human is not None
        bodies.append(human["subject"])
    assert bodies[0] == bodies[2] != bodies[1]
    env.close()


def test_the_force_share_is_that_of_the_contact_limit() -> None:
    """A free contact of the judge: its share is the largest of force and mean pressure, each over its limit."""
    env = CollaborationEnv("Contact", "joint_velocity", changes=["robot.parameters.reflexes:=false"])
    env.reset(seed=1)
    peak, share, largest = 0.0, 0.0, 0.0
    for _ in range(40):
        _, _, ended, _, info = env.step([0.8, 0, 0, 0, 0, 0, 0])
        assert not ended
        share = max(share, info["costs"]["force"])
        for contact, _ in env._judge._watch._rows.values():
            peak = max(peak, contact.peak or 0.0)
            limit = Limits.named().at(contact.regions, None, contact.dominant)
            assert limit is not None and limit.pressure is not None
            ratios = peak / limit.force.transient, peak / 1e-4 / limit.pressure.transient
            largest = max(largest, *ratios)
    assert peak > 5.0 and share == pytest.approx(largest, rel=1e-9)
    env.close()


def test_a_constraint_that_is_not_known_is_not_kept() -> None:
    env = CollaborationEnv("HandGuidance", "end_effector")
    env.reset(seed=1)
    costs = [Costs(not_known=names) for names in ((), ("posture",), ("effort",), ("force", "effort"))]
    assert [env._info(cost)["cost"] for cost in costs] == [0.0, 0.0, 1.0, 2.0]
    env.close()


def test_the_costs_of_a_long_step_are_the_largest_of_its_parts() -> None:
    shares = []
    for step, steps in ((0.04, 50), (0.4, 5)):
        env = CollaborationEnv("HandGuidance", "end_effector", step=step)
        env.reset(seed=1)
        shares.append([env.step(np.zeros(6))[4]["costs"] for _ in range(steps)])
        env.close()
    for index, long in enumerate(shares[1]):
        parts = shares[0][10 * index : 10 * index + 10]
        assert long == {name: max(part[name] for part in parts) for name in long}
    assert len({part["effort"] for part in shares[0][:10]}) > 1


def test_pictures_are_drawn_without_a_display_and_do_not_depend_on_other_environments() -> None:
    lines = (
        "import numpy as np\nfrom hric_gym.environment import CollaborationEnv\n"
        "CollaborationEnv('Reach').close()\n"  # loads MuJoCo
        "a = CollaborationEnv('HandGuidance', 'end_effector', render_mode='rgb_array')\n"
        "b = CollaborationEnv('Reach', person='none', render_mode='rgb_array')\n"
        "for env in (a, b):\n    env.reset(seed=1)\n"
        "before = [env.render() for env in (a, b)]\nafter = [env.render() for env in (a, b)]\n"
        "b.close()\nafter.append(a.render())\na.close()\n"
        "print(before[0].shape, before[0].dtype, before[0].std() > 5)\n"
        "print(*(np.array_equal(x, y) for x, y in zip([*before, before[0]], after)))\n"
    )
    done = subprocess.run([sys.executable, "-c", lines], capture_output=True, text=True, timeout=300)
    assert done.stdout == "(480, 640, 3) uint8 True\nTrue True True\n", done.stderr


@pytest.mark.slow  # 500 episodes, a few minutes
@pytest.mark.parametrize("settings", [{"person": "none"}, {}], ids=["arm", "person"])
def test_the_memory_of_500_episodes_does_not_grow(settings: dict[str, str]) -> None:
    lines = (
        "import json, sys\nimport numpy as np\nfrom hric_gym.environment import CollaborationEnv\n"
        "def memory():\n    return int(open('/proc/self/statm').read().split()[1]) * 4096 / 1e6\n"
        "env = CollaborationEnv('Reach', **json.loads(sys.argv[1]))\n"
        "random, sizes = np.random.default_rng(1), []\n"
        "for episode in range(500):\n"
        "    env.reset(seed=episode)\n"
        "    for _ in range(10):\n"
        "        if env.step(random.uniform(-1, 1, 7))[2]:\n"
        "            break\n"
        "    sizes.append(memory())\n"
        "print(sizes[50], sizes[-1])\n"
    )
    command = [sys.executable, "-c", lines, json.dumps(settings)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=1800, check=True)
    early, late = map(float, done.stdout.split())
    print(f"memory after 50 episodes {early:.1f} MB, after 500 {late:.1f} MB")
    assert late < 1.1 * early
