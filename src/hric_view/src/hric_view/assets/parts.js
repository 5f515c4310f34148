"use strict";
// Parts of a running system beside robots and contact forces: markers, bodies, end effector, plates, muscles, touched
// skin; setpoint, joints near a limit, and the supervisor's decision.
{
  const find = (id) => document.getElementById(id);
  const PER_NEWTON = 0.005; // arrow length of the external force [m/N]
  const NOTHING = { force: [0, 0, 0], point: [0, 0, 0] };
  const GHOST = 0.3; // opacity of the setpoint
  const TINTS = [0x000000, 0xb36a00, 0xa01010]; // light of a link whose joint is far from, near and at a limit
  const KEPT = 20000; // most instants that are kept, as of the scene

  // Values of a running system over time that are not numbers.
  report.History = class {
    constructor() { this.clear(); }
    clear() { Object.assign(this, { times: [], values: [] }); }
    push(t, value) {
      this.times.push(t);
      this.values.push(value);
      if (this.times.length > KEPT) for (const list of [this.times, this.values]) list.splice(0, KEPT / 2);
    }
    at(t) { return this.values[report.countUntil(this.times, t) - 1]; }
  };

  const near = new report.History(), safety = new report.History(), verdicts = new report.History();
  const REPLIES = { yes: "within", warning: "warning", no: "above", unknown: "unknown" }; // colours of replies
  let ghost = null, line = null, shown = "", told = null;

  const makeGhost = (replay) => {
    const bare = { tracks: [], plates: [], arrows: [], tip: null, skin: null, lines: null, motion: null };
    const made = new report.Robot({ ...report.data.scene.robots[0], ...bare }, replay.scene);
    for (const mesh of made.meshes()) {
      Object.assign(mesh.material, { transparent: true, opacity: GHOST, depthWrite: false });
      mesh.material.color.set(report.colour("accent"));
    }
    Object.assign(made.root, { name: "setpoint", visible: false });
    return made;
  };

  report.restarts.push(() => { for (const history of [near, safety, verdicts]) history.clear(); ghost?.restart(); });
  report.on("scene", () => {
    for (const history of [near, safety, verdicts]) history.clear();
    ghost = line = null;
    shown = "";
    find("live-state").hidden = find("of-ghost").hidden = !report.live;
    if (!report.live || !report.replay) return;
    ghost = makeGhost(report.replay);
    line = new THREE.Line(new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(new Float32Array(6), 3)), new THREE.LineBasicMaterial({ depthTest: false }));
    Object.assign(line, { name: "separation", frustumCulled: false, visible: false });
    report.replay.scene.add(line);
  });

  report.parts.push((t, frame) => {
    const { mocap, hand, plates, muscles, touched, setpoint } = frame;
    const [arm, ...others] = report.replay.robots, person = others.find(({ skin, lines }) => skin || lines);
    if (mocap) arm.appendTracks(t, mocap.parent, mocap.values, (name) => name.startsWith("body "));
    if (hand) arm.appendTracks(t, hand.parent, { "end effector": hand.pose }, () => true);
    if (hand || arm.arrows.length) arm.appendArrow(t, "external force", { per_newton: PER_NEWTON, ...(hand || NOTHING) });
    arm.appendPlates(t, plates || []);
    person?.lines?.append(t, (muscles || person.lines.lines.map(() => null)).map((value) => value ?? NaN));
    person?.skin?.append(t, touched || {});
    if (setpoint) ghost.append(t, { q: setpoint.map((value, k) => value ?? frame.robots[0].q[k]) }); // fingers have no setpoint
    near.push(t, frame.near);
    safety.push(t, frame.safety);
    if (frame.verdict) verdicts.push(t, frame.verdict);
  });

  // Tint the link behind each joint that is near a limit.
  const tint = (joints) => {
    const text = JSON.stringify(joints);
    if (text === shown) return;
    shown = text;
    for (const { name, child } of report.replay.robots[0].joints) {
      for (const mesh of child.children) if (mesh.isMesh) mesh.material.emissive?.setHex(TINTS[(joints[name] || [0])[0]]);
    }
  };

  const showVerdict = (verdict) => {
    find("live-verdict").hidden = !verdict;
    if (!verdict || verdict === told) return;
    told = verdict;
    find("until").textContent = `From ${verdict.window[0].toFixed(1)} to ${verdict.window[1].toFixed(1)} s. An estimate of a model, no proof of safety.`;
    find("verdict-lines").replaceChildren(...verdict.lines.map(({ question, reply, number, text }) => {
      const row = document.createElement("tr"), head = document.createElement("th"), cell = document.createElement("td"), mark = document.createElement("span");
      head.textContent = question;
      mark.className = `reply ${REPLIES[reply] || "plain"}`;
      mark.textContent = reply === "unknown" ? "not known" : reply;
      cell.append(mark, ` ${number} ${text}`);
      row.append(head, cell);
      return row;
    }));
  };

  const tell = (name, text) => { find(name).textContent = text; };
  const metres = (value) => (value === null ? "not known" : value.toFixed(3) + " m");

  report.timed.push((t) => {
    if (!report.live || !ghost) return;
    const joints = near.at(t), decision = safety.at(t), known = decision && decision.separation !== null;
    tint(joints || {});
    showVerdict(verdicts.at(t));
    tell("near", joints ? Object.entries(joints).map(([name, [, text]]) => `${name}: ${text}`).join("; ") || "no joint is near a limit" : "not known");
    tell("safety", decision ? `${decision.state}, speed ${decision.scale === null ? "not known" : Math.round(100 * decision.scale) + " %"}${decision.reason && `: ${decision.reason}`}` : "no supervisor");
    tell("distance", decision ? `${metres(decision.separation)}, protective distance ${metres(decision.protective)}` : "not known: no supervisor");
    line.visible = Boolean(known);
    if (known) {
      line.geometry.attributes.position.array.set(decision.points.flat());
      line.geometry.attributes.position.needsUpdate = true;
      line.material.color.set(report.colour(decision.protective !== null && decision.separation > decision.protective ? "within" : "bad"));
    }
    ghost.root.visible = find("show-ghost").checked && ghost.time.length > 0 && t - ghost.time[ghost.time.length - 1] < 1;
    if (ghost.root.visible) ghost.pose(t);
  });

  report.on("frame", ({ pace }) => {
    if (pace === undefined) return;
    if (pace) document.querySelectorAll(".of-pace").forEach((element) => { element.hidden = false; }); // never of a real arm
    const now = pace?.achieved ?? null, requested = pace?.requested ? pace.requested + " x" : "as fast as possible";
    tell("pace-now", pace ? `${requested}, at present ${now === null ? "not known" : now.toFixed(2) + " x"} real time` : "not known");
  });

  report.on("lost", () => tell("pace-now", "not known"));

  find("show-ghost").addEventListener("change", () => report.setTime(report.time));
}
