"""Errors that are pickled and passed to another process."""

import pickle

import pytest

from hric_control.plants.divergence import DivergedError
from hric_core.errors import FAILURE, FailureError, HricError, UnknownNameError


@pytest.mark.parametrize(
    "error",
    [
        DivergedError("elbow", 0.25, "speed", 1e9, "rad/s", "a hundred times its limit"),
        UnknownNameError("joint", "elbw", ["elbow"]),
        FailureError("the disk is full"),
    ],
)
def test_an_error_of_a_worker_process_arrives_whole(error: HricError) -> None:
    arrived = pickle.loads(pickle.dumps(error))
    assert type(arrived) is type(error) and str(arrived) == str(error) and vars(arrived) == vars(error)


def test_the_exit_code_of_a_failure_arrives_too() -> None:
    error = HricError("what was requested did not succeed")
    error.exit_code = FAILURE
    assert pickle.loads(pickle.dumps(error)).exit_code == FAILURE


def test_names_with_commas_are_listed_in_quotes() -> None:
    assert "valid: 'hand, fingers', 'neck' (did you" in str(
        UnknownNameError("region", "necks", ["neck", "hand, fingers"])
    )
    assert "valid: elbow, wrist" in str(UnknownNameError("joint", "x", ["wrist", "elbow"]))
