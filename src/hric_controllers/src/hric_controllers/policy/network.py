"""Network of a policy in an ONNX file, executed on the processor by onnxruntime."""

import time
from pathlib import Path

import numpy as np

from hric_controllers.policy.contract import PolicyContract, Vector
from hric_core.errors import HricError, ParameterError

INPUT, OUTPUT, ACTIONS = "observation", "action", 3
"""Names of input and output of the network, and number of its outputs."""
SAMPLES = 50
"""Number of runs from which the time of a run is measured."""


class PolicyNetwork:
    """Neural network of a policy, with its contract.

    Args:
        path: ONNX file.

    Attributes:
        contract: contract in the file.
        cost: median processor time of a run [s].

    Raises:
        HricError: onnxruntime is not installed.
        ParameterError: the file is not a network that fits its contract.
    """

    def __init__(self, path: Path) -> None:
        try:
            import onnxruntime  # imported here: an optional part of the set-up
        except ImportError:
            raise HricError(
                "a policy needs onnxruntime, which is not installed:  scripts/setup --with learning"
            ) from None
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1  # a thread more costs more than it saves
        try:
            self._session = onnxruntime.InferenceSession(path.read_bytes(), options, providers=["CPUExecutionProvider"])
        except OSError as error:
            raise ParameterError(f"{path} cannot be read: {error.strerror}; valid: a file of hric train") from None
        except Exception as error:  # onnxruntime has no common class of its errors
            reason = str(error).partition("\n")[0][:120]
            raise ParameterError(f"{path} is not an ONNX file: {reason}; valid: a file of hric train") from None
        self.contract = PolicyContract.from_metadata(self._session.get_modelmeta().custom_metadata_map, str(path))
        shapes = [
            (item.name, list(item.shape)[1:]) for item in (*self._session.get_inputs(), *self._session.get_outputs())
        ]
        expected = [(INPUT, [self.contract.size]), (OUTPUT, [ACTIONS])]
        if shapes != expected:
            raise ParameterError(f"{path} has the inputs and outputs {shapes}; valid by its contract: {expected}")
        self.cost = self._measured()

    def __call__(self, observation: Vector) -> Vector:
        """Return the action, shape (3,), for an observation, shape (contract.size,)."""
        result: Vector = self._session.run([OUTPUT], {INPUT: observation[None]})[0][0]
        return result

    def _measured(self) -> float:
        observation, costs = np.zeros(self.contract.size, np.float32), []
        for _ in range(SAMPLES):
            before = time.thread_time()
            self(observation)
            costs.append(time.thread_time() - before)
        return float(np.median(costs))
