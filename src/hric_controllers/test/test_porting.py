"""`hric port` with sources written like public controllers: the interfaces, parameters and topics of three of them."""

import os

import pytest
import yaml
from arm_rig import ArmRig

from hric_controllers.porting.counterparts import CALLS, counterpart
from hric_controllers.porting.reading import Use
from hric_core import command, plugins

IMPEDANCE = """
#include <my_law/impedance.h>
namespace my_law {
/* arm_id would be read by nh.getParam("in_a_comment", x) */
bool Impedance::init(hardware_interface::RobotHW* robot_hw, ros::NodeHandle& nh) {
  sub_ = nh.subscribe("equilibrium_pose", 20, &Impedance::onPose, this);
  if (!nh.getParam("arm_id", arm_id_) || !nh.getParam("joint_names", names_)) return false;
  nh.param("filter", filter_, 0.005);
  nh.param<std::string>("frame", frame_, "panda_link0");
  auto* model = robot_hw->get<franka_hw::FrankaModelInterface>();
  model_ = std::make_unique<franka_hw::FrankaModelHandle>(model->getHandle(arm_id_ + "_model"));
  state_ = std::make_unique<franka_hw::FrankaStateHandle>(
      robot_hw->get<franka_hw::FrankaStateInterface>()->getHandle(arm_id_ + "_robot"));
  auto* joints = robot_hw->get<hardware_interface::EffortJointInterface>();
  for (auto& name : names_) joints_.push_back(joints->getHandle(name));
  error_.init(nh, "error", 1);
  return true;
}
void Impedance::update(const ros::Time&, const ros::Duration&) {
  franka::RobotState state = state_->getRobotState();
  auto jacobian = model_->getZeroJacobian(franka::Frame::kEndEffector);
  for (size_t i = 0; i < 7; ++i) { joints_[i].setCommand(model_->getCoriolis()[i] - state.dq[i]); }
}
}  // namespace my_law
PLUGINLIB_EXPORT_CLASS(my_law::Impedance, controller_interface::ControllerBase)
"""
HEADER = """
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TwistStamped.h>
using geometry_msgs::TwistStamped;
class Impedance : public controller_interface::MultiInterfaceController<franka_hw::FrankaModelInterface,
    hardware_interface::EffortJointInterface, franka_hw::FrankaStateInterface> {
  void onPose(const geometry_msgs::PoseStampedConstPtr& pose);
  std::unique_ptr<franka_hw::FrankaStateHandle> state_;
  std::unique_ptr<franka_hw::FrankaModelHandle> model_;
  std::vector<hardware_interface::JointHandle> joints_;
  realtime_tools::RealtimePublisher<TwistStamped> error_;
};
"""
POSITION = """
bool Position::init(hardware_interface::EffortJointInterface* robot, ros::NodeHandle& n) {
  if (!n.getParam("joint", name_)) return false;
  state_.reset(new realtime_tools::RealtimePublisher<control_msgs::JointControllerState>(n, "state", 1));
  sub_ = n.subscribe<std_msgs::Float64>("command", 1, &Position::onCommand, this);
  hardware_interface::JointHandle joint_ = robot->getHandle(name_);
  return joint_.getPosition() > 0;
}
void Position::update(const ros::Time&, const ros::Duration&) {}
PLUGINLIB_EXPORT_CLASS(my_law::Position, controller_interface::ControllerBase)
"""
WRENCH = """
class Wrench : public controller_interface::Controller<hardware_interface::ForceTorqueSensorInterface> {
  std::vector<hardware_interface::ForceTorqueSensorHandle> sensors_;
  void update(const ros::Time& time, const ros::Duration& period) { use(sensors_[0].getForce()); }
};
"""
NODE = """
import rospy
from geometry_msgs.msg import PoseStamped
import std_msgs.msg

class Lead:
    def __init__(self):
        self.rate = rospy.get_param("~rate", 30.0)
        rospy.Subscriber("target", PoseStamped, self.take)
        rospy.Publisher("command", std_msgs.msg.Float64MultiArray, queue_size=1)
"""


@pytest.fixture
def source(tmp_path):
    """Folder of a catkin package with the sources above."""
    for name, text in {
        "src/impedance.cpp": IMPEDANCE,
        "include/my_law/impedance.h": HEADER,
        "src/position.cpp": POSITION,
        "src/wrench.cpp": WRENCH,
        "lead.py": NODE,
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def rows(output):
    """Return the rows of the printed table as (yes or NO, name, place)."""
    words = [line.split() for line in output.splitlines() if line.startswith(("    yes", "    NO"))]
    return [(one[0], one[1], one[-1]) for one in words]


def test_interfaces_parameters_topics_calls_and_fields_are_listed_with_their_places(source, capsys):
    assert command.main(["port", str(source / "src/impedance.cpp")]) == 0
    assert rows(capsys.readouterr().out) == [
        ("yes", "franka_hw::FrankaModelInterface", "impedance.cpp:10"),
        ("yes", "franka_hw::FrankaStateInterface", "impedance.cpp:13"),
        ("yes", "hardware_interface::EffortJointInterface", "impedance.cpp:14"),
        ("yes", "arm_id", "impedance.cpp:7"),
        ("yes", "joint_names", "impedance.cpp:7"),
        ("yes", "filter", "impedance.cpp:8"),
        ("yes", "frame", "impedance.cpp:9"),
        ("yes", "equilibrium_pose", "impedance.cpp:6"),
        ("yes", "error", "impedance.cpp:16"),
        ("yes", "getRobotState", "impedance.cpp:20"),
        ("yes", "getZeroJacobian", "impedance.cpp:21"),
        ("yes", "setCommand", "impedance.cpp:22"),
        ("yes", "getCoriolis", "impedance.cpp:22"),
        ("yes", "dq", "impedance.cpp:22"),
    ]


def test_the_written_package_loads_on_the_arm_and_ends_where_the_law_is_to_be_written(
    source, tmp_path, monkeypatch, capsys
):
    command.main(["port", str(source / "src/impedance.cpp"), "--output", str(tmp_path / "own/impedance")])
    monkeypatch.setenv("ROS_PACKAGE_PATH", os.pathsep.join([str(tmp_path / "own"), os.environ["ROS_PACKAGE_PATH"]]))
    plugins.clear_cache()
    configured = yaml.safe_load((tmp_path / "own/impedance/config/impedance.yaml").read_text())["impedance"]
    assert configured["type"] == "my_law/Impedance" and configured["filter"] == 0.005
    rig = ArmRig("joint_pd_controller", start=False)
    for name, value in configured.items():
        rig.node.set_param(f"impedance/{name}", value)
    rig.manager.load("impedance")
    rig.manager.switch(["impedance"], [])
    rig.run(0.01)
    assert next(one.state for one in rig.manager.list() if one.name == "impedance") == "aborted"
    assert "lines 19 to 23" in (tmp_path / "own/impedance/src/impedance/law.py").read_text()


def test_a_controller_of_one_joint_gets_its_topics(source, tmp_path, capsys):
    assert command.main(["port", str(source / "src/position.cpp"), "--output", str(tmp_path / "own")]) == 0
    law = (tmp_path / "own/src/position/law.py").read_text()
    assert 'controller_node.subscribe("command", Float64, self.new_command.set, queue_size=1)' in law
    assert 'realtime.publisher(controller_node, "state", JointControllerState)' in law
    assert "robot_hw.get(EffortJointInterface).group([self.joint])" in law


def test_what_is_missing_is_said_in_the_table_and_in_the_package(source, tmp_path, capsys):
    (source / "src/wrench.cpp").write_text(WRENCH.replace("ForceTorqueSensor", "ImuSensor").replace("Force", "Yaw"))
    assert command.main(["port", str(source / "src/wrench.cpp"), "--output", str(tmp_path / "own")]) == 3
    output = capsys.readouterr().out
    assert rows(output)[0][:2] == ("NO", "hardware_interface::ImuSensorInterface")
    assert "no robot has it" in output and "0 of 2 exist in HRIC" in output
    assert "ImuSensorInterface: not in HRIC" in (tmp_path / "own/src/wrench/law.py").read_text()


def test_a_controller_of_sensors_gets_the_wrench_of_the_arm(source, tmp_path, monkeypatch, capsys):
    assert command.main(["port", str(source / "src/wrench.cpp"), "--output", str(tmp_path / "own/wrench")]) == 0
    assert "2 of 2 exist in HRIC" in capsys.readouterr().out
    monkeypatch.setenv("ROS_PACKAGE_PATH", os.pathsep.join([str(tmp_path / "own"), os.environ["ROS_PACKAGE_PATH"]]))
    plugins.clear_cache()
    rig = ArmRig("joint_pd_controller", start=False)
    for name, value in yaml.safe_load((tmp_path / "own/wrench/config/wrench.yaml").read_text())["wrench"].items():
        rig.node.set_param(f"wrench/{name}", value)
    rig.manager.load("wrench")
    sensors = rig.manager._loaded["wrench"].controller.sensors
    assert [(sensor.name, sensor.frame_id, len(sensor.force)) for sensor in sensors] == [("panda_K", "panda_K", 3)]


def test_a_node_in_python_is_read_too(source, capsys):
    assert command.main(["port", str(source / "lead.py")]) == 0
    names = [name for _, name, _ in rows(capsys.readouterr().out)]
    assert names == ["~rate", "target", "command"]


STYLES = """
#include <std_srvs/SetBool.h>
using namespace franka_hw;
namespace hw = hardware_interface;
class Styles : public controller_interface::MultiInterfaceController<FrankaStateInterface, hw::EffortJointInterface,
    hw::ImuSensorInterface> {
  bool init(hw::RobotHW* robot, ros::NodeHandle& root_nh, ros::NodeHandle& nh) override {
    ros::NodeHandle gains(nh, "gains"), inner{gains, "inner"};
    ros::NodeHandle inner_gains(gains, "pid");
    inner_gains.getParam("p", p_);
    root_nh.param<std::string>(std::string("robot_description"), text_, "");
    service_ = nh.advertiseService("enable", &Styles::enable, this);
    sub_ = root_nh.subscribe(ns_ + topic("x"), 1, &Styles::onPose, this);
    client_ = nh.serviceClient<std_srvs::SetBool>("other");
    auto sensor = robot->get<hw::ImuSensorInterface>()->getHandle("imu");
    return robot->get<FrankaStateInterface>()->getHandle("panda_robot").getRobotState().current_errors;
  }
  void onPose(const geometry_msgs::PoseStamped& pose);
  bool enable(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response);
  void update(const ros::Time&, const ros::Duration& period) override {
    for (auto& joint : joints_) joint.setCommand(pid_.computeCommand(joint.getPosition(), period));
    const auto& state = state_->getRobotState();
    const auto& third = arm_.at(2);
    use(third->getVelocity(), (*arm_[1]).getEffort());
    use(state.cartesian_collision);
  }
  std::vector<hw::JointHandle> joints_;
  std::array<std::unique_ptr<hw::JointHandle>, 7> arm_;
  std::unique_ptr<FrankaStateHandle> state_;
  control_toolbox::Pid pid_;
};
"""


@pytest.mark.parametrize(
    "row",
    [
        "yes  franka_hw::FrankaStateInterface",
        "yes  hardware_interface::EffortJointInterface",
        "NO   hardware_interface::ImuSensorInterface",
        "yes  gains/pid/p   controller_node.param",
        "yes  robot_description   root_node.param",
        "yes  enable   SetBool",
        'yes (ns_ + topic("x")) PoseStamped',
        "NO   other   not in a controller",
        "yes  getPosition",
        "yes  getVelocity",
        "yes  getEffort",
        "yes  setCommand",
        "yes  getRobotState",
        "yes  current_errors",
        "yes  cartesian_collision",
        "NO   control_toolbox::Pid   not in HRIC: write the PID law in update()",
    ],
)
def test_other_styles_of_cpp_are_read(row, source, capsys):
    (source / "src/styles.cpp").write_text(STYLES)
    assert command.main(["port", str(source / "src/styles.cpp")]) == 3
    assert " ".join(row.split()) in " ".join(capsys.readouterr().out.split())


PYTHON_STYLES = """
import rospy, moveit_nowhere
import geometry_msgs.msg as gm
from dynamic_reconfigure.server import Server
from franka_msgs.srv import SetLoad
TARGET = "/target"

class Helper:
    pass

class Main:
    WRENCH = "wrench"
    def __init__(self):
        rospy.Subscriber(self.WRENCH, gm.WrenchStamped, self.take)
        rospy.Publisher(name=TARGET, data_class=gm.PoseStamped, queue_size=1)
        rospy.ServiceProxy("/franka_control/set_load", SetLoad)
        rospy.Subscriber(f"{self.name}/x", gm.PoseStamped, self.take)
        self.k = rospy.get_param(param_name="~k", default=3.0)
        self.server = Server(Gains, self.change)
"""


@pytest.mark.parametrize(
    "row",
    [
        "Main",
        "yes  wrench   WrenchStamped",
        "yes  /target   PoseStamped",
        "NO   /franka_control/set_load   not in a controller",
        'yes  ~k   controller_node.param("k")',
        "yes  Gains   controller_node.live_parameters",
        "NO   moveit_nowhere   cannot be imported here",
    ],
)
def test_other_styles_of_python_are_read(row, source, capsys):
    (source / "styles.py").write_text(PYTHON_STYLES)
    assert command.main(["port", str(source / "styles.py")]) == 3
    assert " ".join(row.split()) in " ".join(capsys.readouterr().out.split())


def test_the_package_gets_private_names_and_no_computed_ones(source, tmp_path):
    (source / "styles.py").write_text(PYTHON_STYLES)
    command.main(["port", str(source / "styles.py"), "--output", str(tmp_path / "own")])
    law = (tmp_path / "own/src/main/law.py").read_text()
    assert 'self.k = controller_node.param("k", 3.0)' in law
    assert 'controller_node.subscribe("wrench", WrenchStamped' in law
    assert "# styles.py:17: subscriber (f'{self.name}/x'): PoseStamped" in law and 'subscribe("(' not in law
    assert "  k: 3.0\n" in (tmp_path / "own/config/main.yaml").read_text()


def test_headers_that_headers_include_are_read(source, capsys):
    (source / "src/position.cpp").write_text(
        "#include <my_law/position.h>\nPLUGINLIB_EXPORT_CLASS(my_law::Position, controller_interface::ControllerBase)"
    )
    (source / "include/my_law/position.h").write_text("#include <my_law/position_impl.h>\n")
    (source / "include/my_law/position_impl.h").write_text(POSITION.rpartition("PLUGINLIB")[0])
    assert command.main(["port", str(source / "src/position.cpp")]) == 0
    assert ("yes", "joint", "position_impl.h:3") in rows(capsys.readouterr().out)


def test_a_table_without_the_law_is_called_incomplete(source, capsys):
    (source / "src/position.cpp").write_text(POSITION.replace("::update", "::renew"))
    assert command.main(["port", str(source / "src/position.cpp")]) == 3
    assert "update() is not in these files" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("file", "before", "after"),
    [("src/position.cpp", '"joint"', "kind + name"), ("lead.py", '"~rate"', "KIND")],
)
def test_a_computed_name_is_to_be_written_out_by_hand(file, before, after, source, capsys):
    (source / file).write_text((source / file).read_text().replace(before, after))
    command.main(["port", str(source / file)])
    line = next(line for line in capsys.readouterr().out.splitlines() if f"({after})" in line)
    assert "a computed name: write it out by hand" in line


def test_the_other_controllers_of_a_source_are_named(source, capsys):
    (source / "src/both.cpp").write_text(POSITION + WRENCH + POSITION.replace("Position", "Velocity"))
    command.main(["port", str(source / "src/both.cpp")])
    assert "The source also has Velocity, Wrench: the table contains what they use, too" in capsys.readouterr().out


def test_a_controller_that_exists_here_needs_no_port(source, capsys):
    exported = (
        "PLUGINLIB_EXPORT_CLASS(effort_controllers::JointTrajectoryController, controller_interface::ControllerBase)"
    )
    (source / "src/position.cpp").write_text(exported)
    command.main(["port", str(source / "src/position.cpp")])
    assert "HRIC has a controller of this type" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["missing.cpp"], "missing.cpp: No such file"),
        (["src/wrench.cpp", "lead.py"], "give one Python file, or the C++ files of one controller"),
        (["src/wrench.cpp", "--output", "src"], "exists; name a new folder"),
        (["include/my_law/other.h"], "no class is derived from"),
        (["broken.py"], "is not Python 3"),
        (["src/ros2.cpp"], "ros2.cpp is written for ROS 2 (rclcpp); valid: a controller of ros_control"),
    ],
)
def test_a_mistake_is_one_sentence_and_writes_nothing(words, said, source, monkeypatch, capsys):
    (source / "include/my_law/other.h").write_text("int x;")
    (source / "broken.py").write_text("def f(:\n")
    (source / "src/ros2.cpp").write_text('#include "rclcpp/rclcpp.hpp"\nrclcpp::Node node;')
    monkeypatch.chdir(source)
    assert command.main(["port", *words]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


@pytest.mark.parametrize("name", sorted(CALLS))
def test_each_call_of_the_table_is_an_attribute_of_a_handle_here(name):
    from franka_hw_interface.interfaces import FrankaCartesianPoseHandle, FrankaStateHandle
    from franka_hw_interface.model import FrankaModelHandle
    from hric_control.hardware_interface import ForceTorqueSensorHandle, JointGroup, JointHandle

    kinds = (
        ForceTorqueSensorHandle,
        FrankaModelHandle,
        JointHandle,
        JointGroup,
        FrankaCartesianPoseHandle,
        FrankaStateHandle,
    )
    attribute = counterpart(Use("call", name, "JointHandle", "")).text.split("(")[0].split(" ")[0]
    assert any(hasattr(kind, attribute) for kind in kinds)
