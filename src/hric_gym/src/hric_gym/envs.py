"""Registration of the environments with Gymnasium: `import hric_gym.envs`, then `gymnasium.make("hric/Reach-v0")`."""

from hric_gym.environment import CollaborationEnv
from hric_gym.spaces import register
from hric_gym.tasks import TASKS

__all__ = ["IDS", "CollaborationEnv"]
IDS = {f"hric/{name}-v0": name for name in TASKS}
"""Name of the task of each environment, by the environment's id such as hric/Reach-v0."""

for identity, name in IDS.items():
    register(identity, entry_point="hric_gym.environment:CollaborationEnv", kwargs={"task": name})
