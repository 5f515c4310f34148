"use strict";
// Controls of the window: they send commands, which the server checks. Nothing moves before control has been taken.
{
  const find = (id) => document.getElementById(id);
  const AXES = ["x", "y", "z"], TURN = 3.5; // turn of one jog per its length [rad/m]
  const RENEW = 100, REACH = 150; // period of a push that is held [ms]; newtons per metre of pull
  const SETTLED = 1500; // time after a command for which a slider shows its target, not the measured position [ms]
  let limits = null, mine = false, sliders = new Map(), push = null, touched = -Infinity, listed = "";

  const send = (command, values = {}) => report.send({ command, ...values });
  const button = (text, label, act) => {
    const made = document.createElement("button");
    Object.assign(made, { type: "button", textContent: text });
    made.setAttribute("aria-label", label);
    made.addEventListener("click", act);
    return made;
  };

  const degrees = (radians) => ((radians * 180) / Math.PI).toFixed(1) + " deg";

  const makeSliders = () => {
    sliders = new Map();
    const short = (name) => name.replace(/^.*_/, ""), names = Object.keys(limits.limits);
    const unique = new Set(names.map(short)).size === names.length;  // not so if there are several arms
    find("joints").replaceChildren(...Object.entries(limits.limits).map(([name, [lower, upper]]) => {
      const label = document.createElement("label"), input = document.createElement("input"), text = document.createElement("output");
      Object.assign(input, { type: "range", min: lower, max: upper, step: 0.001 });
      input.setAttribute("aria-label", name);
      input.addEventListener("input", () => { touched = performance.now(); text.textContent = degrees(Number(input.value)); });
      input.addEventListener("change", () => { touched = performance.now(); send("joints", { positions: { [name]: Number(input.value) } }); });
      label.append(unique ? short(name) : name, " ", input, " ", text);
      sliders.set(name, { input, text });
      return label;
    }));
  };

  // Show the measured positions, except while a slider is used.
  const followArm = (frame) => {
    if (performance.now() - touched < SETTLED || !report.replay) return;
    for (const joint of report.replay.robots[0].joints) {
      const slider = sliders.get(joint.name), value = frame.robots[0].q[joint.column];
      if (!slider || value === null) continue;
      slider.input.value = value;
      slider.text.textContent = degrees(value);
    }
  };

  const makeJogs = () => {
    const jog = (index, sign) => {
      const displacement = Array(6).fill(0), size = Number(find("jog-size").value);
      displacement[index] = sign * (index < 3 ? size : size * TURN);
      send("jog", { displacement });
    };
    find("jogs").replaceChildren(...[0, 1, 2, 3, 4, 5].flatMap((index) => [-1, 1].map((sign) => {
      const name = (index < 3 ? "" : "turn ") + AXES[index % 3];
      return button(`${sign < 0 ? "-" : "+"} ${name}`, `end effector ${sign < 0 ? "minus" : "plus"} ${name}`, () => jog(index, sign));
    })));
  };

  // An unpaced simulation stays so; a pace that is none of the choices leaves the list blank.
  const showPace = (requested) => {
    find("pace").disabled = !requested;
    if (document.activeElement !== find("pace")) find("pace").value = String(requested);
  };

  const showControllers = (controllers) => {
    const text = JSON.stringify(controllers);
    if (text === listed) return; // do not take the focus from a button
    listed = text;
    const moving = controllers.filter(({ moves, state }) => moves && state === "running").map(({ name }) => name);
    find("controllers").replaceChildren(...controllers.map(({ name, state, moves }) => {
      const item = document.createElement("li");
      item.append(`${name}: ${state} `);
      if (moves && state === "running") item.append(button("stop", `stop ${name}`, () => send("switch", { start: "", stop: [name] })));
      else if (moves) item.append(button(moving.length ? `start, and stop ${moving.join(", ")}` : "start", `start ${name}`, () => send("switch", { start: name, stop: moving })));
      return item;
    }));
  };

  // Push with the mouse: a force at the point where it was pressed, towards the pointer, in the plane of the screen.
  const pointer = (event) => {
    const box = event.target.getBoundingClientRect();
    return new THREE.Vector2((2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height);
  };

  const grab = (event) => {
    if (!find("pushing").checked || !mine || !report.replay) return;
    const ray = new THREE.Raycaster(), robot = report.replay.robots[0];
    ray.setFromCamera(pointer(event), report.replay.camera);
    const [hit] = ray.intersectObjects(robot.meshes(), false);
    if (!hit) return;
    event.stopPropagation(); // the view does not turn
    event.target.setPointerCapture(event.pointerId);
    const link = hit.object.parent, point = link.worldToLocal(hit.point.clone());
    push = { link, point, force: new THREE.Vector3(), arrow: new THREE.ArrowHelper(new THREE.Vector3(1, 0, 0), hit.point, 0.1, report.colour("limit")) };
    report.replay.scene.add(push.arrow);
    push.timer = setInterval(renew, RENEW);
  };

  const pull = (event) => {
    if (!push) return;
    event.stopPropagation();
    const { camera } = report.replay, at = push.link.localToWorld(push.point.clone()), ray = new THREE.Raycaster();
    ray.setFromCamera(pointer(event), camera);
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(camera.getWorldDirection(new THREE.Vector3()), at);
    const target = ray.ray.intersectPlane(plane, new THREE.Vector3());
    if (target) push.force.copy(target.sub(at).multiplyScalar(REACH)).clampLength(0, limits.push);
    show();
  };

  const show = () => {
    const size = push.force.length();
    find("push-text").textContent = size.toFixed(0) + " N";
    push.arrow.position.copy(push.link.localToWorld(push.point.clone()));
    if (size > 0) { push.arrow.setDirection(push.force.clone().normalize()); push.arrow.setLength(0.05 + size / REACH); }
    report.replay.ask();
  };

  const renew = () => {
    show();
    if (push.force.length() > 0.5) send("push", { link: push.link.name, point: push.point.toArray(), force: push.force.toArray() });
  };

  const letGo = () => {
    if (!push) return;
    clearInterval(push.timer);
    report.replay.scene.remove(push.arrow);
    push = null;
    find("push-text").textContent = "";
    report.replay.ask();
  };

  report.on("scene", (message) => {
    limits = message.control;
    makeSliders();
    makeJogs();
    letGo();
    find("width").max = limits.width;
  });

  report.on("frame", (frame) => {
    followArm(frame);
    if (frame.pace !== undefined) showPace(frame.pace?.requested);
    if (!frame.control) return;
    const { holder, mode, stands, simulated, controllers, gripper, recovery, emulated } = frame.control;
    find("holder").textContent = mine ? "You control the arm." : holder ? `${holder} controls the arm.` : "Nobody controls the arm.";
    find("mode").textContent = mode;
    find("stands").textContent = stands ? ", time stands still" : "";
    find("recover").disabled = mode === "move";
    find("recover").title = mode === "move" ? "the arm has no error" : "";
    for (const [kind, shown] of [[".of-sim", simulated], [".of-gripper", gripper], [".of-franka", recovery], [".of-emulated", emulated]]) document.querySelectorAll(kind).forEach((element) => { element.hidden = !shown; });
    for (const button of document.querySelectorAll(".of-emulated button")) button.textContent = `${mode === button.dataset.mode ? "release" : "press"} the ${button.dataset.name}`;
    showControllers(controllers);
  });

  report.on("control", ({ held }) => {
    mine = held;
    find("commands").disabled = !held;
    find("take").textContent = held ? "release control" : "take control";
    if (!held) letGo();
  });

  report.on("lost", () => {
    mine = false;
    find("holder").textContent = find("mode").textContent = "Not known: the connection is lost.";
    find("stands").textContent = "";
    find("commands").disabled = true;
    find("take").textContent = "take control";
    letGo();
  });

  for (const [name, act] of [["pointerdown", grab], ["pointermove", pull], ["pointerup", letGo], ["pointercancel", letGo]]) find("view").addEventListener(name, act, true);
  find("take").addEventListener("click", () => (mine ? send("release") : send("take", { name: find("who").value })));
  find("pause").addEventListener("click", () => send("pause"));
  find("proceed").addEventListener("click", () => send("proceed"));
  find("step").addEventListener("click", () => send("step", { cycles: Math.round(Number(find("cycles").value)) }));
  find("reset").addEventListener("click", () => send("reset"));
  find("pace").addEventListener("change", () => { send("pace", { factor: Number(find("pace").value) }); find("pace").blur(); });
  find("recover").addEventListener("click", () => send("recover"));
  for (const button of document.querySelectorAll(".of-emulated button")) button.addEventListener("click", () => send("press", { button: button.id, pressed: button.textContent.startsWith("press") }));
  find("width").addEventListener("input", () => { find("width-text").textContent = (1000 * Number(find("width").value)).toFixed(0) + " mm"; });
  find("width").addEventListener("change", () => send("grip", { width: Number(find("width").value) }));
}
