"use strict";
// Handle at the end effector: an arrow moves it along an axis of its frame, a ring turns it about one, by commands "jog".
{
  const find = (id) => document.getElementById(id);
  const COLOURS = [0xd04040, 0x30a050, 0x4070e0]; // x, y, z
  const PART = 0.12; // length of an arrow per distance of the camera
  const PERIOD = 100; // time between two commands [ms]
  const MOST = [0.02, 0.1], LEAST = [1e-4, 5e-4]; // largest and smallest step of a command [m], [rad]
  const OLD = 1000; // age from which on the pose of the end effector counts as old [ms]
  let handle = null, seen = -Infinity, base = null, drag = null;

  // Return the arrow and the ring of an axis (0 to 2), of length 1, each with a wider body that the pointer hits.
  const makeAxis = (axis) => {
    const material = new THREE.MeshBasicMaterial({ color: COLOURS[axis], depthTest: false, transparent: true, opacity: 0.85 });
    const along = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 1, 0), new THREE.Vector3().setComponent(axis, 1));
    const about = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 0, 1), new THREE.Vector3().setComponent(axis, 1));
    const arrow = [new THREE.CylinderGeometry(0.02, 0.02, 0.8, 8).translate(0, 0.4, 0), new THREE.ConeGeometry(0.06, 0.2, 12).translate(0, 0.9, 0), new THREE.CylinderGeometry(0.12, 0.12, 0.7, 6).translate(0, 0.75, 0)];
    const ring = [new THREE.TorusGeometry(0.6, 0.015, 6, 48), new THREE.TorusGeometry(0.6, 0.08, 4, 24)];
    return [[arrow, along, false], [ring, about, true]].flatMap(([shapes, turned, turns]) => shapes.map((shape, k) => {
      const mesh = new THREE.Mesh(shape, material), wide = k === shapes.length - 1;
      Object.assign(mesh, { visible: !wide, renderOrder: 10, userData: wide ? { axis, turns } : {} });
      mesh.quaternion.copy(turned);
      return mesh;
    }));
  };

  const mayDrag = () => find("dragging").checked && !find("commands").disabled && find("live").getAttribute("aria-pressed") === "true" && performance.now() - seen < OLD;

  const show = () => {
    if (!handle) return;
    if (!mayDrag()) letGo();
    handle.visible = mayDrag();
    handle.scale.setScalar(PART * handle.getWorldPosition(new THREE.Vector3()).distanceTo(report.replay.camera.position));
    report.replay.ask();
  };

  const pointer = (event) => {
    const box = event.target.getBoundingClientRect(), ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2((2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height), report.replay.camera);
    return ray;
  };

  // Return the place on a line, from its origin [m], that is nearest to the pointer; null: one looks along the line.
  const place = (event, { origin, direction }) => {
    const { ray } = pointer(event), from = origin.clone().sub(ray.origin), b = direction.dot(ray.direction);
    return 1 - b * b < 0.02 ? null : (b * from.dot(ray.direction) - from.dot(direction)) / (1 - b * b);
  };

  const grab = (event) => {
    if (!handle?.visible || !mayDrag()) return;
    handle.updateWorldMatrix(true, true);
    const [hit] = pointer(event).intersectObjects(handle.children.filter(({ userData }) => "axis" in userData), false);
    if (!hit) return;
    event.stopImmediatePropagation(); // the view does not turn, and nothing is pushed
    event.target.setPointerCapture(event.pointerId);
    const { axis, turns } = hit.object.userData, inBase = new THREE.Vector3().setComponent(axis, 1).applyQuaternion(handle.quaternion);
    const direction = inBase.clone().transformDirection(base.matrixWorld), middle = handle.getWorldPosition(new THREE.Vector3());
    const arm = hit.point.clone().sub(middle);
    if (turns) direction.cross(arm.addScaledVector(direction, -arm.dot(direction))).normalize(); // along the ring
    const line = { origin: turns ? hit.point.clone() : middle, direction };
    drag = { line, turns, axis: inBase, start: place(event, line) ?? 0, per: turns ? 1 / arm.length() : 1, wanted: 0, sent: 0, timer: setInterval(step, PERIOD) };
  };

  const pull = (event) => {
    if (!drag) return;
    event.stopImmediatePropagation();
    const at = place(event, drag.line);
    if (at !== null) drag.wanted = (at - drag.start) * drag.per;
  };

  // Send the next step towards the pointer.
  const step = () => {
    const kind = Number(drag.turns), delta = Math.min(Math.max(drag.wanted - drag.sent, -MOST[kind]), MOST[kind]);
    if (!mayDrag()) return letGo();
    if (Math.abs(delta) < LEAST[kind]) return;
    const vector = drag.axis.clone().multiplyScalar(delta).toArray(), none = [0, 0, 0];
    drag.sent += delta;
    if (!report.send({ command: "jog", displacement: drag.turns ? [...none, ...vector] : [...vector, ...none] })) letGo();
  };

  const letGo = () => {
    if (drag) clearInterval(drag.timer);
    drag = null;
  };

  report.on("scene", () => {
    letGo();
    handle = null; // it ended with the scene before
  });

  report.on("frame", ({ hand }) => {
    if (hand && report.replay) {
      seen = performance.now();
      handle ||= new THREE.Group().add(...[0, 1, 2].flatMap(makeAxis));
      base = report.replay.robots[0].links.get(hand.parent) || report.replay.robots[0].root;
      if (handle.parent !== base) base.add(handle);
      handle.position.fromArray(hand.pose);
      handle.quaternion.fromArray(hand.pose, 3);
    }
    show();
  });

  for (const type of ["control", "lost", "refused"]) report.on(type, letGo);
  for (const [name, act] of [["pointerdown", grab], ["pointermove", pull], ["pointerup", letGo], ["pointercancel", letGo]]) find("view").addEventListener(name, act, true);
  find("dragging").addEventListener("change", show);
}
