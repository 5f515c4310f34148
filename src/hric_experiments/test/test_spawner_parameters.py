"""The spawner sets the parameters of an experiment on the parameter server of a real master."""

from pathlib import Path

import pytest
import yaml
from real_master import ros, roscore

from hric_run.definition import experiment

__all__ = ["ros", "roscore"]
pytestmark = pytest.mark.alone


def test_parameters_outside_the_controllers_are_on_the_server(ros: str, tmp_path: Path) -> None:
    import rospy

    from hric_experiments.live import spawner

    raw = yaml.safe_load((experiment.config_path("experiments") / "pd_step.yaml").read_text())
    raw["global_parameters"] = {"/robot_ip": "172.16.0.2", "cell/table": {"height": 0.8}}
    raw["parameters"] = {"joint_pd_controller": {"profile": None}}
    path = tmp_path / "own.yaml"
    path.write_text(yaml.safe_dump(raw))
    spawner.configure(experiment.load(str(path)))
    assert rospy.get_param("/robot_ip") == "172.16.0.2"
    assert rospy.get_param("cell/table/height") == 0.8
    assert rospy.get_param("joint_pd_controller/type").endswith("JointPDController")
    assert not rospy.has_param("joint_pd_controller/profile")
