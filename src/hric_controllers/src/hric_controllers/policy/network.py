"""Network of a policy in an ONNX file, executed on the processor by onnxruntime."""

import time
from pathlib import Path

import numpy as np

from hric_controllers.policy.contract import PolicyContract, Vector
from hric_core.errors import FailureError, HricError, ParameterError

INPUT, OUTPUT, ACTIONS, FLOAT = "observation", "action", 3, "tensor(float)"
"""Names of input and output of the network, number of its outputs, and type of both."""
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
        options.log_severity_level = 4  # its errors become exceptions
        options.intra_op_num_threads = options.inter_op_num_threads = 1  # a thread more costs more than it saves
        try:
            self._session = onnxruntime.InferenceSession(path.read_bytes(), options, providers=["CPUExecutionProvider"])
        except OSError as error:
            raise ParameterError(f"{path} cannot be read: {error.strerror}; valid: a file by hric train") from None
        except Exception as error:  # onnxruntime has no common class of its errors
            reason = str(error).partition("\n")[0][:120]
            raise ParameterError(f"{path} is not an ONNX file: {reason}; valid: a file by hric train") from None
        self.contract = PolicyContract.from_metadata(self._session.get_modelmeta().custom_metadata_map, str(path))
        form = [
            (item.name, item.type, list(item.shape)[1:])
            for item in (*self._session.get_inputs(), *self._session.get_outputs())
        ]
        expected = [(INPUT, FLOAT, [self.contract.size]), (OUTPUT, FLOAT, [ACTIONS])]
        if form != expected:
            raise ParameterError(f"{path} has the inputs and outputs {form}; valid by its contract: {expected}")
        self._path = path
        try:
            self.cost = self._measured()
        except FailureError as error:
            raise ParameterError(f"{error}; valid: a file by hric train") from None

    def __call__(self, observation: Vector) -> Vector:
        """Return the action, shape (3,), for an observation, shape (contract.size,).

        Raises:
            FailureError: onnxruntime cannot execute the network.
        """
        try:
            result: Vector = self._session.run([OUTPUT], {INPUT: observation[None]})[0][0]
        except Exception as error:  # onnxruntime has no common class of its errors
            reason = " ".join(str(error).split())[:200]
            raise FailureError(f"the network in {self._path} cannot be executed: {reason}") from None
        return result

    def _measured(self) -> float:
        observation, costs = np.zeros(self.contract.size, np.float32), []
        for _ in range(SAMPLES):
            before = time.thread_time()
            self(observation)
            costs.append(time.thread_time() - before)
        return float(np.median(costs))
