"""Programs of users of libfranka who move one of two arms; `panda` (panda-python) and `fr3` (pylibfranka) are their
bindings."""

from fci_clients import CONNECT_FR3, CONNECT_PANDA

COMMON = """
import socket
TARGET = json.loads(sys.argv[2])
DURATION = float(sys.argv[3])  # of the motion [s of robot time]
def smooth(s):  # 0 to 1 with continuous jerk
    s = min(max(s, 0.0), 1.0)
    return s**4 * (35.0 - 84.0 * s + 70.0 * s**2 - 20.0 * s**3)
found = {"error": "", "cycles": 0, "rate": 1.0, "force": 0.0}
at = []  # wall time of each cycle [s]
def note(state):
    at.append(time.monotonic())
    found["cycles"] += 1
    found["cycles"] == 300 and print("runs", flush=True)
    if found["cycles"] > 1:
        found["rate"] = min(found["rate"], state.control_command_success_rate)
    found["force"] = max(found["force"], math.hypot(*list(state.O_F_ext_hat_K)[:3]))
def tell():
    if found["error"]:
        time.sleep(0.1)  # until the state shows the reflex
    state = robot.read_once()
    if len(at) > 3000:
        found["pace"] = (at[300] - at[100]) / 200.0 / ((at[-1] - at[-1000]) / 999.0)  # at the end, relative to the beginning
    print(json.dumps(found | {"q": list(state.q), "mode": str(state.robot_mode), "errors": repr(state.last_motion_errors)}))
"""  # noqa: E501

MOVE = (
    CONNECT_PANDA
    + COMMON
    + """
print("connected", flush=True)
sys.stdin.readline()
start, begin = None, None
def callback(state, period):
    global start, begin
    note(state)
    start, begin = start or list(state.q_d), state.time.to_sec() if begin is None else begin
    s = (state.time.to_sec() - begin) / DURATION
    command = franka.JointPositions([a + smooth(s) * (b - a) for a, b in zip(start, TARGET)])
    return franka.motion_finished(command) if s > 1.0 else command
try:
    robot.control_joint_position(callback, franka.ControllerMode.kJointImpedance)
except RuntimeError as error:
    found["error"] = " ".join(str(error).split())
tell()
"""
)
"""Joint motion to a target, after a line on the standard input."""

LEAD = (
    MOVE.replace(
        "    note(state)\n",
        "    note(state)\n    sender.send(json.dumps([state.time.to_sec(), list(state.q)]).encode())\n"
        "    ready = ready or bool(select.select([sender], [], [], 0.0)[0])\n"
        "    if not ready:\n        return franka.JointPositions(list(state.q_d))\n",
    )
    .replace(
        "start, begin = None, None\n",
        "import select\nstart, begin, ready = None, None, False\n"
        "sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)\nsender.connect(('127.0.0.1', int(sys.argv[4])))\n",
    )
    .replace("global start, begin", "global start, begin, ready")
    .replace("tell()\n", "sender.send(b'end')\ntell()\n")
)
"""The same, with the measured joint positions of each cycle sent to another program, after that one has answered."""

FOLLOW = """
import select
receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
receiver.bind(("127.0.0.1", 0))
receiver.settimeout(20.0)
print(receiver.getsockname()[1], flush=True)
leader, ended, answered = {}, False, False
found["tracking"] = 0.0
def take():
    global ended, answered
    text, sender = receiver.recvfrom(4096)
    ended = text == b"end"
    if not ended:
        at, q = json.loads(text)
        leader[round(1000.0 * at)] = q
        if not answered and found["cycles"] > 50:
            receiver.sendto(b"ready", sender)
            answered = True
def leads(state):  # joint positions of the leader in the cycle of this state
    now = round(1000.0 * state.time.to_sec())
    note(state)
    while not leader and select.select([receiver], [], [], 0.0)[0]:
        take()
    if not leader or now < min(leader):
        return list(state.q_d)
    while now not in leader and not ended:
        take()
    goal = leader.get(now, leader[max(leader)])
    found["tracking"] = max(found["tracking"], *(abs(a - b) for a, b in zip(goal, state.q)))
    return goal
"""

FOLLOW_PANDA = (
    CONNECT_PANDA
    + COMMON
    + FOLLOW
    + """
def callback(state, period):
    command = franka.JointPositions(leads(state))
    return franka.motion_finished(command) if ended else command
try:
    robot.control_joint_position(callback, franka.ControllerMode.kJointImpedance)
except RuntimeError as error:
    found["error"] = " ".join(str(error).split())
tell()
"""
)
"""Joint positions of the other arm, streamed through libfranka's filter and its rate limits."""

FOLLOW_FR3 = (
    CONNECT_FR3
    + COMMON
    + FOLLOW
    + """
STIFFNESS, DAMPING = [600.0] * 4 + [250.0, 150.0, 50.0], [50.0] * 4 + [30.0, 25.0, 15.0]  # as in libfranka's examples
control, model = robot.start_torque_control(), robot.load_model()
while not ended:
    state, _ = control.readOnce()
    q, coriolis = leads(state), model.coriolis(state)
    tau = [k * (g - x) - d * v + c for k, g, x, d, v, c in zip(STIFFNESS, q, state.q, DAMPING, state.dq, coriolis)]
    torques = franka.Torques(tau)
    torques.motion_finished = ended
    control.writeOnce(torques)
del control
tell()
"""
)
"""Joint positions of the other arm, as the goal of an impedance controller of the user's own."""
