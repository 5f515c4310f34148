"""Training, export and evaluation of policies, and the committed policy in environment and controller."""

import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hric_core.command import perform
from hric_core.errors import HricError

pytest.importorskip("stable_baselines3", reason="scripts/setup --with learning")
pytest.importorskip("onnxruntime", reason="scripts/setup --with learning")

from stable_baselines3 import SAC
from stable_baselines3.common.save_util import load_from_pkl

from hric_controllers.cartesian.workspace import Box
from hric_controllers.policy.network import PolicyNetwork
from hric_gym.evaluation import POLICY, REFLEX, SCRIPTED, EpisodeResult, ScriptedReach, passed, played, table
from hric_gym.policy_env import TOLERATED, contract, environment, force_excess
from hric_gym.spaces import unit_box
from hric_gym.training import ASCENT, CAREFUL, LIMITED, SLOWEST, CostBuffer, TrainingEnv, _CostLimit, export, train
from hric_run.definition import experiment
from hric_run.simulation import Simulation

CONFIG = Path(__file__).resolve().parents[1] / "config"
COMMITTED = CONFIG / "reach.onnx"
HRIC = [sys.executable, "-c", "import sys; from hric_core.command import main; sys.exit(main())"]


def agreed(steps: int = 1000, **training: Any) -> Any:
    return contract("Reach", {"steps": steps, "seed": 3, "weights": {"force": 0.1, "effort": 0.1}, **training})


@pytest.mark.parametrize(("training", "least"), [({}, SLOWEST), ({"cost_limit": ["stopping", 0.3]}, CAREFUL)])
def test_the_exported_network_acts_as_the_policy_of_stable_baselines3_on_the_straight_line(
    tmp_path: Path, training: dict[str, Any], least: float
) -> None:
    policy = agreed(**training)
    env = TrainingEnv(environment(policy), policy)
    model = SAC("MlpPolicy", env, seed=1, buffer_size=10, policy_kwargs={"net_arch": [64, 64]})
    export(model, policy, tmp_path / "policy.onnx")
    network, random = PolicyNetwork(tmp_path / "policy.onnx"), np.random.default_rng(2)
    for _ in range(20):
        observation = random.normal(size=env.observation_space.shape).astype(np.float32)
        action, _ = model.predict(observation, deterministic=True)
        speed = least + (1.0 - least) * 0.5 * (action + 1.0)
        expected = speed * observation[-3:] / np.abs(observation[-3:]).max()
        np.testing.assert_allclose(network(observation), expected, atol=1e-6)
    assert network.contract == policy and network.contract.fields[-1].name == "goal_offset"
    assert np.isfinite(network(np.zeros(env.observation_space.shape, np.float32))).all()
    env.close()


@pytest.mark.slow  # two trainings of a minute each
def test_the_same_seed_trains_the_same_file_in_another_process(tmp_path: Path) -> None:
    contents = []
    for name in ("first.onnx", "second.onnx"):
        command = [*HRIC, "train", "Reach", "--steps", "2000", "--seed", "5", "--output", str(tmp_path / name)]
        subprocess.run(command, check=True, capture_output=True, timeout=600)
        contents.append((tmp_path / name).read_bytes())
    assert contents[0] == contents[1]


@pytest.mark.slow  # two trainings of a minute each
@pytest.mark.parametrize("limit", [(), ("--cost-limit", "stopping", "0")])
def test_ctrl_c_leaves_a_policy_and_a_checkpoint_from_which_the_training_goes_on(
    tmp_path: Path, limit: tuple[str, ...]
) -> None:
    command = [*HRIC, "train", "Reach", "--output", str(tmp_path / "policy.onnx")]
    process = subprocess.Popen([*command, "--steps", "1300", *limit], stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    shown = ""
    while "return" not in shown:  # shown after the first episode; the bar is written without line ends
        shown = (shown + process.stderr.read(20))[-400:]
        assert process.poll() is None, shown
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=120)
    assert process.returncode == 130
    before = SAC.load(tmp_path / "policy.zip").num_timesteps
    assert 0 < before < 1300 and PolicyNetwork(tmp_path / "policy.onnx").contract.training["steps"] == 1300
    assert isinstance(load_from_pkl(tmp_path / "policy.replay"), CostBuffer) is bool(limit)
    done = subprocess.run([*command, "--resume"], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert SAC.load(tmp_path / "policy.zip").num_timesteps == 1300
    buffer, training = (
        load_from_pkl(tmp_path / "policy.replay"),
        PolicyNetwork(tmp_path / "policy.onnx").contract.training,
    )
    assert isinstance(buffer, CostBuffer) is bool(limit) and ("cost_limit" in training) is bool(limit)
    assert buffer.size() == 1299, "the interrupted step is not stored"
    assert not limit or 0.0 < buffer.weight <= ASCENT * float(buffer._costs.sum()) * (1.0 + 1e-6)


@pytest.mark.slow  # a training of a minute
def test_a_killed_training_goes_on_from_its_last_checkpoint(tmp_path: Path) -> None:
    command = [*HRIC, "train", "Reach", "--output", str(tmp_path / "policy.onnx")]
    process = subprocess.Popen([*command, "--steps", "1100"], stderr=subprocess.DEVNULL)
    try:
        while not (tmp_path / "policy.onnx").exists():  # the last of its files
            assert process.poll() is None
            time.sleep(0.01)
    finally:
        process.kill()
        process.wait()
    assert SAC.load(tmp_path / "policy.zip").num_timesteps == 1000
    assert load_from_pkl(tmp_path / "policy.replay").size() == 1000
    subprocess.run([*command, "--resume"], check=True, capture_output=True, timeout=300)
    assert SAC.load(tmp_path / "policy.zip").num_timesteps == 1100


@pytest.mark.parametrize("name", ["policy.onnx", "policy.zip", "policy.replay"])
def test_a_new_training_replaces_no_file(tmp_path: Path, name: str) -> None:
    (tmp_path / name).touch()
    with pytest.raises(HricError, match=f"{name} exists; valid: another name with --output, or --resume"):
        perform(["train", "Reach", "--output", str(tmp_path / "policy.onnx")])


def test_a_training_has_no_seed_of_the_episodes_of_an_evaluation(tmp_path: Path) -> None:
    with pytest.raises(HricError, match="--seed is 1000000; valid: a whole number from 0 to 999999"):
        perform(["train", "Reach", "--output", str(tmp_path / "policy.onnx"), "--seed", "1000000"])


def test_a_policy_is_evaluated_with_its_own_period_and_with_no_other_speed_goals_or_robot() -> None:
    policy = replace(agreed(), period=0.1)
    env = environment(policy)
    assert env.unwrapped.period == 0.1
    env.close()
    for change, message in (
        ({"action_scale": 0.1}, "action_scale .* 0.1 m/s; .*: 0.7 m/s"),
        ({"near": 0.05}, "0.03 m"),
        ({"goals": Box([0.3, -0.3, 0.2], [0.6, 0.3, 0.6])}, "valid in hric_gym: x 0.35 to 0.6, "),
        ({"robot": replace(policy.robot, ee_position=[0.3, 0.27, 0.46])}, "the policy is of another robot: ee_pos"),
        ({"robot": None}, "the robot of the policy is not known"),
    ):
        with pytest.raises(HricError, match=message):
            environment(replace(policy, **change))


def test_the_weight_of_the_cost_follows_its_limit_and_applies_to_stored_steps() -> None:
    one = unit_box(1)
    buffer = CostBuffer(4, one, one)
    ascent, zero = _CostLimit("force", 0.3), np.zeros((1, 1), np.float32)
    for cost, above, done in ((1.0, True, False), (0.2, False, True), (0.5, False, False), (0.0, False, True)):
        info = [{LIMITED: cost, "violations": ("force",) if above else (), "not_known": ()}]
        dones = np.array([done])
        ascent.update_locals({"infos": info, "dones": dones, "replay_buffer": buffer})
        assert ascent._on_step()
        buffer.add(zero, zero, zero, np.array([-1.0], np.float32), dones, info)
    assert buffer.weight == pytest.approx(ASCENT * (1.0 - 0.3 - 0.3))
    rewards = buffer._get_samples(np.arange(4)).rewards.numpy()
    np.testing.assert_allclose(rewards[:, 0], -1.0 - buffer.weight * np.array([1.0, 0.2, 0.5, 0.0]), rtol=1e-6)
    assert all(ascent._on_step() for _ in range(6)) and buffer.weight == 0.0
    ascent.update_locals({"infos": [info[0] | {"not_known": ("force",)}], "dones": dones, "replay_buffer": buffer})
    assert ascent._on_step() and buffer.weight == pytest.approx(ASCENT * 0.7)


def test_without_a_checkpoint_nothing_is_resumed(tmp_path: Path) -> None:
    with pytest.raises(HricError, match="of which one is missing"):
        train(agreed(), tmp_path / "policy.onnx", resume=True)


def test_a_resumed_training_takes_no_other_settings() -> None:
    with pytest.raises(HricError, match="valid: --resume without --steps"):
        perform(["train", "Reach", "--resume", "--steps", "2000"])


def test_a_training_is_resumed_with_its_own_task_only() -> None:
    with pytest.raises(HricError, match=r"reach.onnx is no policy of the task Contact; valid with --resume: Reach"):
        perform(["train", "Contact", "--resume", "--output", str(COMMITTED)])


@pytest.mark.parametrize(
    ("limit", "message"),
    [(("stopping", "1.5"), "--cost-limit is 1.5"), (("stoping", "0.3"), "no cost 'stoping'; valid: .*stopping")],
)
def test_an_impossible_cost_limit_is_refused(limit: tuple[str, str], message: str) -> None:
    with pytest.raises(HricError, match=message):
        perform(["train", "Reach", "--cost-limit", *limit])


@pytest.mark.parametrize(("cost", "limited"), [("separation", 1.0), ("heat", 1.0), ("force", 0.0)])
def test_a_cost_far_above_its_limit_or_not_known_counts_fully_and_a_small_one_not(cost: str, limited: float) -> None:
    """The separation exceeds its limit in each step of this task, even if the arm is at rest."""
    training = agreed(cost_limit=[cost, 0.3])
    env = TrainingEnv(environment(training), training)
    env.reset(seed=4)
    info = env.step(np.zeros(1, np.float32))[4]
    env.close()
    assert info["costs"]["separation"] > 1.5 and "heat" not in info["costs"] and info["costs"]["force"] == 0.0
    assert info[LIMITED] == limited


@pytest.mark.slow  # two trainings of half a minute each
@pytest.mark.parametrize(("limit", "above"), [(0.0, True), (1.0, False)])
def test_a_training_weighs_a_cost_only_above_its_limit(tmp_path: Path, limit: float, above: bool) -> None:
    training = agreed(cost_limit=["separation", limit])
    assert train(training, tmp_path / "policy.onnx")
    assert (load_from_pkl(tmp_path / "policy.replay").weight > 1.0) is above
    assert PolicyNetwork(tmp_path / "policy.onnx").contract == training


def test_only_a_force_above_the_tolerated_share_costs_and_an_unknown_one_costs_most() -> None:
    shares = (0.0, TOLERATED, 0.3, float("inf"))
    assert [force_excess({"force": share}) for share in shares] == pytest.approx([0.0, 0.0, 0.2, 0.9])
    assert force_excess({}) == 0.0


def test_a_task_whose_goal_moves_is_refused() -> None:
    with pytest.raises(HricError, match="no task 'Handover'; valid: Reach"):
        environment(contract("Handover", {}))


def test_the_committed_policy_moves_the_arm_as_controller_as_in_the_environment() -> None:
    """The controller decides one cycle later, as it reads the state at the start of a cycle."""
    network = PolicyNetwork(COMMITTED)
    env = environment(network.contract)
    observation, _ = env.reset(seed=7)
    q_start, goal, rows = env.fields["q"].tolist(), env.fields["goal"].tolist(), []
    for _ in range(15):
        rows.append(env.fields["q"])
        observation, _, ended, _, _ = env.step(network(observation))
        if ended:
            break
    env.close()
    definition = experiment.load(str(CONFIG / "reach_policy.yaml"), [])
    definition = replace(
        definition, human=None, parameters={"policy_controller": {"file": str(COMMITTED), "goal": goal}}
    )
    with Simulation(definition, **{}) as simulation:
        simulation.reset(q_start=q_start, in_place=True)
        simulation.run(0.04 * len(rows))
        q = simulation.signals.position[::40]
    assert np.ptp(rows, axis=0).max() > 0.2
    np.testing.assert_allclose(q[: len(rows)], rows, atol=0.02)


def test_the_scripted_reach_reaches_and_the_resting_arm_does_not() -> None:
    env = environment(agreed())
    reach = played(env, ScriptedReach(env.unwrapped, 0.7), 11)
    rest = played(env, lambda *_: np.zeros(3), 11)
    again = played(env, ScriptedReach(env.unwrapped, 0.7), 11)
    env.close()
    assert reach == again and reach.success and not rest.success and reach.score > rest.score
    assert rest.seconds == pytest.approx(4.0) and reach.seconds < 2.5


def episodes(score: float, count: int, above: int) -> list[EpisodeResult]:
    ends = [(frozenset({REFLEX}), "joint_reflex") if k < above else (frozenset[str](), "") for k in range(count)]
    return [
        EpisodeResult(score + 0.1 * (k % 3), True, 1.0, limits, 0.5, 3.0, reflex)
        for k, (limits, reflex) in enumerate(ends)
    ]


@pytest.mark.parametrize(
    ("score", "above", "good"), [(-2.0, 0, True), (-2.0, 2, True), (-2.0, 3, False), (-3.0, 0, False), (-4.0, 0, False)]
)
def test_a_policy_passes_if_it_scores_better_and_at_most_one_percent_exceed_a_limit(
    score: float, above: int, good: bool
) -> None:
    results = {POLICY: episodes(score, 200, above), SCRIPTED: episodes(-3.0, 200, 0)}
    assert passed(results) is good
    shown = table(results)
    assert f"force or reflex {above} (" in shown and "stopping 0 (0.0 to 1.8 %)" in shown
    assert f"reflexes of policy: {f'joint_reflex {above}' if above else 'none'}\n" in shown


@pytest.mark.parametrize(("share", "kept"), [(0.077, False), (0.078, True)])
def test_a_cost_limit_is_kept_if_the_whole_interval_is_below_it(share: float, kept: bool) -> None:
    """8 of 200: the exact 95 % interval ends at 7.7 %."""
    results = {POLICY: episodes(-4.0, 200, 0), SCRIPTED: episodes(-3.0, 200, 0)}
    results[POLICY][:8] = [replace(episode, violations=frozenset({"stopping"})) for episode in results[POLICY][:8]]
    limit = ["stopping", share]
    assert passed(results, limit) is kept
    text = f"stopping above its limit in at most {100.0 * share:g} % of the episodes: "
    assert text + ("kept" if kept else "not shown to be kept") in table(results, limit)
