"""Gymnasium and PettingZoo environments of collaborations of the arm with a person; `hric_gym.envs` registers them."""
