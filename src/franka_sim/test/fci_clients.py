"""Programs of users of panda-python (protocol 5) and pylibfranka (protocol 10), run in processes of their own."""

CONNECT_PANDA = """
import json, math, sys, time
from panda_py import libfranka as franka
robot = franka.Robot(sys.argv[1], franka.RealtimeConfig.kIgnore)
STEPS = 500
def ramp(k):  # 0 to 1, at rest at both ends, its derivative per cycle
    s = min(k / STEPS, 1.0)
    return 0.5 - 0.5 * math.cos(math.pi * s), 0.5 * math.pi / STEPS * math.sin(math.pi * s)
"""
CONNECT_FR3 = CONNECT_PANDA.replace("from panda_py import libfranka as franka", "import pylibfranka as franka")
HOLD = """
start = list(robot.read_once().q)
rates, drift, count = [], 0.0, 0
def callback(state, period):
    global count, drift
    count += 1
    rates.append(state.control_command_success_rate)
    drift = max(drift, max(abs(a - b) for a, b in zip(state.q, start)))
    torques = franka.Torques([0.0] * 7)
    return franka.motion_finished(torques) if count == int(sys.argv[2]) else torques
"""
HOLD_PANDA = CONNECT_PANDA + HOLD + "robot.control(callback)\nprint(json.dumps([count, min(rates[1:]), drift]))\n"
HOLD_FR3 = (
    CONNECT_FR3
    + HOLD.replace(
        "return franka.motion_finished(torques) if count == int(sys.argv[2]) else torques",
        "torques.motion_finished = count == int(sys.argv[2])\n    return torques",
    )
    + """
control = robot.start_torque_control()
while count < int(sys.argv[2]):
    control.writeOnce(callback(*control.readOnce()))
print(json.dumps([count, min(rates[1:]), drift]))
"""
)
MODES_PANDA = (
    CONNECT_PANDA
    + """
def run(name, make, *arguments):
    global k, first
    k, first = 0, None
    def callback(state, *period):
        global k, first
        first = first or (list(state.q_d), list(state.O_T_EE_c))
        k += 1
        command = make(state)
        return franka.motion_finished(command) if k > STEPS else command
    def with_torques(state, period):
        return franka.Torques([0.0] * 7)
    getattr(robot, name)(*([with_torques] if "_torque" in name else []), callback, *arguments)
    return [a - b for a, b in zip(robot.read_once().q, first[0])], [a - b for a, b in zip(robot.read_once().O_T_EE, first[1])]
def joint_position(state):
    return franka.JointPositions([q + 0.1 * ramp(k)[0] * (i == 3) for i, q in enumerate(first[0])])
def joint_velocity(state):
    return franka.JointVelocities([100.0 * ramp(k)[1] * (i == 3) for i in range(7)])
def pose(state):
    T = list(first[1])
    T[14] -= 0.05 * ramp(k)[0]
    return franka.CartesianPose(T)
def velocity(state):
    return franka.CartesianVelocities([0.0, 0.0, -50.0 * ramp(k)[1], 0.0, 0.0, 0.0])
found = {}
joint, cartesian = franka.ControllerMode.kJointImpedance, franka.ControllerMode.kCartesianImpedance
found["joint position"] = run("control_joint_position", joint_position, joint)[0][3]
found["joint velocity"] = run("control_joint_velocity", joint_velocity, joint)[0][3]
found["joint position, Cartesian impedance"] = run("control_joint_position", joint_position, cartesian)[0][3]
found["Cartesian pose"] = 2.0 * -run("control_cartesian_pose", pose, joint)[1][14]
found["Cartesian velocity"] = 2.0 * -run("control_cartesian_velocity", velocity, joint)[1][14]
found["Cartesian pose, Cartesian impedance"] = 2.0 * -run("control_cartesian_pose", pose, cartesian)[1][14]
print(json.dumps(found))
"""  # noqa: E501
)
MODES_FR3 = (
    CONNECT_FR3
    + """
def run(start, make, *arguments):
    global first
    control = getattr(robot, start)(*arguments)
    for k in range(STEPS + 1):
        state, _ = control.readOnce()
        if k == 0:
            first = list(state.q_d), list(state.O_T_EE_c)
        command = make(k)
        command.motion_finished = k == STEPS
        control.writeOnce(command)
    del control
    robot.read_once()
    state = robot.read_once()
    return [a - b for a, b in zip(state.q, first[0])], [a - b for a, b in zip(state.O_T_EE, first[1])]
def pose(k):
    T = list(first[1])
    T[14] -= 0.05 * ramp(k)[0]
    return franka.CartesianPose(T)
joint, cartesian, found = franka.ControllerMode.JointImpedance, franka.ControllerMode.CartesianImpedance, {}
position = lambda k: franka.JointPositions([q + 0.1 * ramp(k)[0] * (i == 3) for i, q in enumerate(first[0])])
velocity = lambda k: franka.JointVelocities([100.0 * ramp(k)[1] * (i == 3) for i in range(7)])
twist = lambda k: franka.CartesianVelocities([0.0, 0.0, -50.0 * ramp(k)[1], 0.0, 0.0, 0.0])
found["joint position"] = run("start_joint_position_control", position, joint)[0][3]
found["joint velocity"] = run("start_joint_velocity_control", velocity, joint)[0][3]
found["Cartesian pose"] = 2.0 * -run("start_cartesian_pose_control", pose, joint)[1][14]
found["Cartesian velocity"] = 2.0 * -run("start_cartesian_velocity_control", twist, joint)[1][14]
found["joint position, Cartesian impedance"] = run("start_joint_position_control", position, cartesian)[0][3]
found["Cartesian pose, Cartesian impedance"] = 2.0 * -run("start_cartesian_pose_control", pose, cartesian)[1][14]
print(json.dumps(found))
"""
)
JUMP = (
    CONNECT_PANDA
    + """
def callback(state, period):
    return franka.Torques([0.0] * 6 + [10.0])
for _ in range(2):
    try:
        robot.control(callback, False, 1000.0)
    except RuntimeError as error:
        print(" ".join(str(error).split()))
print(robot.read_once().robot_mode)
robot.automatic_error_recovery()
print(robot.read_once().robot_mode, repr(robot.read_once().current_errors), repr(robot.read_once().last_motion_errors))
"""
)
NAN_PANDA = (
    CONNECT_PANDA
    + """
def bad(state, period):
    return franka.Torques([0.0] * 6 + [math.nan])
try:
    robot.control(bad)
except Exception as error:
    print(" ".join(str(error).split()))
count = 0
def good(state, period):
    global count
    count += 1
    torques = franka.Torques([0.0] * 7)
    return franka.motion_finished(torques) if count == 100 else torques
robot.control(good)
print(count)
"""
)
NAN_FR3 = (
    CONNECT_FR3
    + """
control = robot.start_torque_control()
control.readOnce()
try:
    control.writeOnce(franka.Torques([0.0] * 6 + [math.nan]))
except Exception as error:
    print(" ".join(str(error).split()))
del control
control, count = robot.start_torque_control(), 0
while count < 100:
    control.readOnce()
    count += 1
    torques = franka.Torques([0.0] * 7)
    torques.motion_finished = count == 100
    control.writeOnce(torques)
print(count)
"""
)
SETTERS = (
    CONNECT_PANDA
    + """
eye = [1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
robot.set_load(1.5, [0.0, 0.0, 0.1], [0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.01])
robot.set_k(eye[:12] + [0.0, 0.0, 0.2, 1.0])
robot.set_joint_impedance([1000.0] * 7)
robot.set_cartesian_impedance([1000.0] * 3 + [50.0] * 3)
robot.set_collision_behavior([30.0] * 7, [40.0] * 7, [30.0] * 6, [40.0] * 6)
robot.set_guiding_mode([True] * 6, True)
before = robot.read_once().O_T_EE
robot.set_ee(eye[:12] + [0.0, 0.0, 0.1, 1.0])
for _ in range(3):
    state = robot.read_once()
print(json.dumps([state.m_load, list(state.EE_T_K)[14], before[14] - list(state.O_T_EE)[14]]))
try:
    robot.set_load(-1.0, [0.0] * 3, [0.0] * 9)
except RuntimeError as error:
    print(error)
"""
)
MODEL = (
    CONNECT_PANDA
    + """
model, state = robot.load_model(), robot.read_once()
print(json.dumps([list(model.gravity(state)), list(state.tau_J)]))
"""
)
