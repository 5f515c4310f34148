"use strict";
// Scene of the replay: robots, whose joints move their links, and markers and frames with their own motion. z is up.
{
  const LOST = 0.25; // a marker without data for this time is hidden [s]
  const TRAIL = 8, TRAIL_POINTS = 3000; // length of a trail [s], and maximum number of its points in a run
  const PER_NEWTON = 0.002, THICK = 0.02; // arrow length of a plate's force [m/N]; thickness of a plate below its surface [m]
  const geometries = new Map();

  const meshGeometry = (number) => {
    if (!geometries.has(number)) {
      const mesh = report.data.scene.meshes[number], geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.BufferAttribute(report.read(mesh.vertices), 3));
      geometry.setIndex(new THREE.BufferAttribute(report.read(mesh.faces), 1));
      geometry.computeVertexNormals();
      geometries.set(number, geometry);
    }
    return geometries.get(number);
  };

  const geometryOf = (visual) => {
    if ("mesh" in visual) return meshGeometry(visual.mesh);
    if (visual.box) return new THREE.BoxGeometry(...visual.box);
    if (visual.sphere) return new THREE.SphereGeometry(visual.sphere[0], 32, 16);
    const [radius, length] = visual.cylinder;
    return new THREE.CylinderGeometry(radius, radius, length, 32).rotateX(Math.PI / 2); // URDF: axis along z
  };

  const place = (object, { xyz, quaternion }) => {
    object.position.fromArray(xyz);
    object.quaternion.fromArray(quaternion);
    return object;
  };

  // Return the index of the last instant at or before t, the share of the step to the next one, and the step [s].
  const between = (times, t) => {
    const k = Math.min(Math.max(report.countUntil(times, t) - 1, 0), Math.max(times.length - 2, 0));
    const step = k + 1 < times.length ? times[k + 1] - times[k] : 0;
    return [k, step > 0 ? Math.min(Math.max((t - times[k]) / step, 0), 1) : 0, step];
  };

  // Add an instant of a running system to the arrays of a part; values: by name of the array, its numbers at time t.
  const grow = (part, t, values) => {
    part.rows ||= Object.fromEntries(Object.entries({ time: [t], ...values }).map(([name, row]) => [name, new Rows(name === "time" ? Float64Array : Float32Array, row.length)]));
    for (const [name, row] of Object.entries({ time: [t], ...values })) part[name] = part.rows[name].push(row);
  };
  const EMPTY = () => ({ time: new Float64Array(0), values: new Float32Array(0), force: new Float32Array(0), point: new Float32Array(0) });

  class Track {
    constructor(spec) {
      Object.assign(this, spec, { time: report.read(spec.time), values: report.read(spec.values) });
      this.width = this.values.length / this.time.length;
      this.object = spec.kind === "marker" ? new THREE.Mesh(new THREE.SphereGeometry(0.009, 16, 12), new THREE.MeshLambertMaterial()) : new THREE.AxesHelper(0.12);
      this.object.name = spec.name;
    }

    append(t, values) {
      grow(this, t, { values });
      this.width = values.length;
    }

    show(t) {
      const [k, f, step] = between(this.time, t), w = this.width, last = this.time.length - 1;
      const a = this.values.subarray(k * w, k * w + w), b = last ? this.values.subarray((k + 1) * w, (k + 2) * w) : a;
      const seen = Number.isFinite(a[0]) && Number.isFinite(b[0]) && step < LOST && t > this.time[0] - LOST && t < this.time[last] + LOST;
      this.object.visible = seen;
      if (!seen) return;
      this.object.position.fromArray(a).lerp(new THREE.Vector3().fromArray(b), f);
      if (w === 7) this.object.quaternion.fromArray(a, 3).slerp(new THREE.Quaternion().fromArray(b, 3), f);
    }
  }

  // Trail: path of the last TRAIL seconds; points: x, y, z at each instant, NaN: not visible. track: of a running system,
  // whose points are copied when they are shown.
  class Trail {
    constructor(time, points, role, track) {
      Object.assign(this, { time, role, track });
      const geometry = new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(points, 3));
      this.object = new THREE.Line(geometry, new THREE.LineBasicMaterial());
      this.object.frustumCulled = false;
    }

    show(t) {
      const time = this.track ? this.track.time : this.time, last = report.countUntil(time, t);
      const first = Math.max(report.countUntil(time, t - TRAIL), this.track ? last - TRAIL_POINTS : 0);
      if (this.track) this.copy(first, last);
      this.object.geometry.setDrawRange(this.track ? 0 : first, last - first);
      this.object.visible = last - first > 1;
    }

    copy(first, last) {
      const { values, width } = this.track, { position } = this.object.geometry.attributes;
      for (let k = first; k < last; k++) position.array.set(values.subarray(k * width, k * width + 3), 3 * (k - first));
      position.needsUpdate = true;
    }
  }

  const UP = new THREE.Vector3(0, 1, 0), SHAFT = 0.005, HEAD = [0.013, 0.035]; // arrow: radius of the shaft; radius and length of the head [m]

  // Arrow of a force that starts or ends at its point of action, and is visible through bodies.
  class Arrow {
    constructor(spec) {
      Object.assign(this, spec, { time: report.read(spec.time), force: report.read(spec.force), point: spec.point && report.read(spec.point) });
      this.material = new THREE.MeshBasicMaterial({ depthTest: false, transparent: true });
      this.shaft = new THREE.Mesh(new THREE.CylinderGeometry(SHAFT, SHAFT, 1, 12).translate(0, 0.5, 0), this.material);
      this.head = new THREE.Mesh(new THREE.ConeGeometry(...HEAD, 16).translate(0, -HEAD[1] / 2, 0), this.material);
      this.object = new THREE.Group().add(this.shaft, this.head);
      this.object.name = spec.name || "";
    }

    // Add an instant of a running system; point: in the frame of the arrow's parent, if it moves there.
    append(t, force, point) {
      grow(this, t, point ? { force, point } : { force });
    }

    show(t) {
      const k = report.countUntil(this.time, t) - 1, force = new THREE.Vector3(), { object } = this;
      if (k >= 0) force.fromArray(this.force, 3 * k);
      this.known = k >= 0 && Number.isFinite(force.x);
      const length = force.length() * this.per_newton;
      object.visible = length > 0.005;
      if (!object.visible) return;
      if (this.point) object.position.fromArray(this.point, 3 * k); else object.position.set(0, 0, 0);
      if (this.ends) object.position.addScaledVector(force, -this.per_newton);
      object.quaternion.setFromUnitVectors(UP, force.normalize());
      this.shaft.scale.y = Math.max(length - HEAD[1], 1e-4);
      this.head.position.y = length;
    }
  }

  // Surface of a force plate, and the arrow of the force on it.
  class Plate {
    constructor(spec) {
      this.object = place(new THREE.Group(), spec);
      this.object.name = spec.name;
      this.box = new THREE.Mesh(new THREE.BoxGeometry(spec.size[0], spec.size[1], THICK), new THREE.MeshLambertMaterial({ transparent: true, opacity: 0.8 }));
      this.box.position.z = -THICK / 2;
      this.arrow = new Arrow({ time: spec.time, force: spec.force, per_newton: PER_NEWTON, ends: true });
      this.object.add(this.box, this.arrow.object);
    }

    // A plate whose force is not known is faint.
    show(t) {
      this.arrow.show(t);
      this.box.material.opacity = this.arrow.known ? 0.8 : 0.25;
    }
  }

  // Return the worse of two shares of a limit; null, not known, is worse than any below 1.
  const worse = (a, b) => (a === null || b === null ? (Math.max(a, b) >= 1 ? Math.max(a, b) : null) : Math.max(a, b));

  const TOUCH = 0.25; // shortest time that a contact is shown [s]
  const TOUCHES = 8000; // most contacts of a running system that are kept
  const BUNDLE = 0.0035; // radius of a line [m]
  const UNKNOWN = "#9aa0a6"; // colour of a line whose value is not known

  // Lines (muscle paths) through points fixed to links, coloured by value over time, visible through the body.
  class Lines {
    constructor(spec, links) {
      Object.assign(this, { scale: spec.scale, title: spec.title, time: report.read(spec.time), values: report.read(spec.values) });
      this.object = new THREE.Group();
      this.lines = Object.entries(spec.points).map(([name, points]) => {
        const material = new THREE.MeshBasicMaterial({ depthTest: false, transparent: true, opacity: 0.9 });
        const parts = points.slice(1).map(() => new THREE.Mesh(new THREE.CylinderGeometry(BUNDLE, BUNDLE, 1, 8).translate(0, 0.5, 0), material));
        this.object.add(...parts);
        return { name, material, parts, points: points.map(([link, xyz]) => [links.get(link), new THREE.Vector3().fromArray(xyz)]) };
      });
      this.object.name = spec.title;
    }

    append(t, values) {
      grow(this, t, { values });
    }

    // Show the lines at time t; requires that the links have their poses for this time.
    show(t) {
      const [k, f] = between(this.time, t), n = this.lines.length, next = Math.min(k + 1, this.time.length - 1);
      this.lines.forEach(({ material, parts, points }, i) => {
        const value = (1 - f) * this.values[k * n + i] + f * this.values[next * n + i];
        material.color.set(this.colour(value));
        const at = points.map(([link, xyz]) => link.localToWorld(xyz.clone()));
        parts.forEach((part, j) => {
          const way = at[j + 1].clone().sub(at[j]);
          part.renderOrder = value || 0; // the largest value is on top
          part.scale.y = Math.max(way.length(), 1e-6);
          part.position.copy(at[j]);
          part.quaternion.setFromUnitVectors(UP, way.normalize());
        });
      });
    }

    colour(value) {
      if (!Number.isFinite(value)) return new THREE.Color(UNKNOWN);
      const high = Math.max(1, Math.min(this.scale.findIndex(([at]) => at >= value), this.scale.length - 1)), last = this.scale[this.scale.length - 1];
      if (value >= last[0]) return new THREE.Color(last[1]);
      const [[a, from], [b, to]] = [this.scale[high - 1], this.scale[high]];
      return new THREE.Color(from).lerp(new THREE.Color(to), Math.min(Math.max((value - a) / (b - a), 0), 1));
    }
  }

  // Surface that follows links: linear blend skinning with the links as bones.
  class Skin {
    constructor(spec, links) {
      const geometry = new THREE.BufferGeometry();
      const add = (name, place, width) => geometry.setAttribute(name, new THREE.BufferAttribute(place, width));
      add("position", report.read(spec.vertices), 3);
      add("color", report.read(spec.colours), 3);
      add("skinIndex", Uint16Array.from(report.read(spec.indices)), 4);
      add("skinWeight", report.read(spec.weights), 4);
      geometry.setIndex(new THREE.BufferAttribute(report.read(spec.faces), 1));
      geometry.computeVertexNormals();
      Object.assign(this, { spec, clothes: report.read(spec.colours).slice(), regions: report.read(spec.regions), shown: "{}" });
      this.object = new THREE.SkinnedMesh(geometry, new THREE.MeshPhongMaterial({ vertexColors: true, specular: 0x0a0a0a, side: THREE.DoubleSide }));
      this.object.frustumCulled = false;
      const inverses = report.read(spec.inverses), bones = spec.links.map((name) => links.get(name));
      const inverse = (k) => new THREE.Matrix4().fromArray(inverses, 16 * k).transpose(); // rows there, columns here
      this.object.bind(new THREE.Skeleton(bones, bones.map((_, k) => inverse(k))), new THREE.Matrix4());
    }

    // Colour regions by share of their limit. shares: by name of the region, "right lower arm, wrist"; null: not known.
    // All other regions have the colours of the clothes.
    colour(shares) {
      const wanted = JSON.stringify(shares), { color } = this.object.geometry.attributes;
      if (wanted === this.shown) return;
      this.shown = wanted;
      const colours = this.spec.keys.map((key) => (key in shares ? this.shade(shares[key]) : null));
      color.array.set(this.clothes);
      this.regions.forEach((region, k) => { if (colours[region]) color.array.set(colours[region], 3 * k); });
      color.needsUpdate = true;
    }

    shade(share) {
      const { scale, unknown } = this.spec, k = scale.findIndex(([at]) => at >= share);
      if (share === null) return unknown;
      if (k < 1) return scale[k < 0 ? scale.length - 1 : 0][1];
      const [[low, from], [high, to]] = [scale[k - 1], scale[k]];
      return from.map((value, c) => value + ((share - low) / (high - low)) * (to[c] - value));
    }

    // Add the shares of the limit of the regions that are touched at an instant of a running system; the oldest go.
    append(t, shares) {
      const { touches } = this.spec;
      for (const [region, share] of Object.entries(shares)) touches.push([t, t, [region], share]);
      if (touches.length > TOUCHES) touches.splice(0, touches.length - TOUCHES / 2);
    }

    // Colour the regions that are touched at time t, each by the largest share; one of several that is not known hides those below 100 %.
    show(t) {
      const shares = {};
      for (const [begin, end, regions, share] of this.spec.touches) {
        if (t < begin || t > Math.max(end, begin + TOUCH)) continue;
        for (const region of regions) shares[region] = region in shares ? worse(shares[region], share) : share;
      }
      this.colour(shares);
    }
  }

  const INSTANTS = 20000; // most instants of a running system that are kept: 11 minutes at 30 Hz

  // Array that grows by rows; when it is full, the older half goes.
  class Rows {
    constructor(kind, width) {
      Object.assign(this, { width, data: new kind(64 * width), rows: 0 });
    }

    push(row) {
      if ((this.rows + 1) * this.width > this.data.length) {
        const kept = this.rows < INSTANTS ? 0 : this.rows >> 1, left = this.data.subarray(kept * this.width, this.rows * this.width);
        const larger = new this.data.constructor(this.rows < INSTANTS ? 2 * this.data.length : this.data.length);
        larger.set(left);
        Object.assign(this, { data: larger, rows: this.rows - kept });
      }
      this.data.set(row, this.rows++ * this.width);
      return this.data.subarray(0, this.rows * this.width);
    }
  }

  class Robot {
    constructor(spec, scene) {
      Object.assign(this, { label: spec.label, role: spec.role, joints: [], links: new Map() });
      this.time = report.read(spec.time);
      this.position = report.read(spec.position);
      this.columns = spec.columns;
      this.axes = new THREE.Group();
      for (const link of spec.links) this.links.set(link.name, this.makeLink(link));
      const roots = new Set(this.links.keys());
      for (const joint of spec.joints) {
        const holder = place(new THREE.Group(), joint), child = this.links.get(joint.child);
        this.links.get(joint.parent).add(holder.add(child));
        roots.delete(joint.child);
        if (joint.column !== null) this.joints.push({ ...joint, child, axis: new THREE.Vector3().fromArray(joint.axis).normalize() });
      }
      for (const name of roots) scene.add(place(this.links.get(name), spec.pose));
      const root = this.root = this.links.get([...roots][0]);
      this.motion = spec.motion && new Track(spec.motion);
      this.tracks = spec.tracks.map((track) => new Track(track));
      for (const track of this.tracks) (this.links.get(track.parent) || root).add(track.object);
      this.plates = spec.plates.map((plate) => new Plate(plate));
      this.plates.forEach((plate, k) => (this.links.get(spec.plates[k].parent) || root).add(plate.object));
      this.arrows = spec.arrows.map((arrow) => new Arrow(arrow));
      for (const arrow of this.arrows) (this.links.get(arrow.parent) || scene).add(arrow.object);
      this.lines = spec.lines && new Lines(spec.lines, this.links);
      if (this.lines) scene.add(this.lines.object);
      this.skin = spec.skin && new Skin(spec.skin, this.links);
      if (this.skin) scene.add(this.skin.object);
      this.trails = [...this.trailOfTip(spec.tip, scene), ...this.trailsOfTracks()];
    }

    // Add an instant of a running system: joint positions q, null where unknown, and the pose of the root if it moves.
    append(t, { q, root }) {
      const before = this.position.subarray(-this.columns);
      grow(this, t, { position: q.map((value, k) => value ?? before[k] ?? 0) });
      if (!root) return;
      this.motion ||= new Track({ kind: "frame", name: "root", ...EMPTY() });
      this.motion.append(t, root);
    }

    // Add an instant of markers and frames of a running system: by name position, or pose, in the axes of a link.
    // trail: returns whether a name has a trail.
    appendTracks(t, parent, values, trail) {
      const at = this.links.get(parent) || this.root;
      for (const [name, value] of Object.entries(values)) {
        const known = this.tracks.find((track) => track.name === name);
        (known || this.addTrack(name, value.length === 3 ? "marker" : "frame", at, trail(name))).append(t, value);
      }
    }

    addTrack(name, kind, at, trail) {
      const track = new Track({ kind, name, ...EMPTY() });
      this.tracks.push(track);
      at.add(track.object);
      if (trail) {
        this.trails.push(new Trail(null, new Float32Array(3 * TRAIL_POINTS), "marker", track));
        at.add(this.trails[this.trails.length - 1].object);
      }
      this.paint(false);
      return track;
    }

    // Add an instant of the force plates of a running system, each with its place.
    appendPlates(t, plates) {
      for (const spec of plates) {
        let plate = this.plates.find(({ object }) => object.name === spec.name);
        if (!plate) {
          this.plates.push((plate = new Plate({ ...spec, ...EMPTY() })));
          (this.links.get(spec.parent) || this.root).add(plate.object);
          this.paint(false);
        }
        plate.arrow.append(t, spec.force || [NaN, NaN, NaN]);
      }
    }

    // Add an instant of a force of a running system; parent: link in whose axes force and point are.
    appendArrow(t, name, { parent, force, point, per_newton }) {
      let arrow = this.arrows.find((one) => one.name === name);
      if (!arrow) {
        this.arrows.push((arrow = new Arrow({ name, colour: "measured", per_newton, ...EMPTY() })));
        (this.links.get(parent) || this.root).add(arrow.object);
        this.paint(false);
      }
      arrow.append(t, force, point);
    }

    // Forget what a running system has sent: its time began anew.
    restart() {
      const parts = [this, this.motion, this.lines, ...this.tracks, ...this.arrows, ...this.plates.map(({ arrow }) => arrow)];
      for (const part of parts) if (part) delete part.rows;
      this.skin?.spec.touches.splice(0);
    }

    // Return the trail of the end effector, in the world frame.
    trailOfTip(tip, scene) {
      const link = tip && this.links.get(tip.link);
      if (!link) return [];
      const count = Math.min(this.time.length, TRAIL_POINTS), time = new Float64Array(count), points = new Float32Array(3 * count), point = new THREE.Vector3();
      for (let k = 0; k < count; k++) {
        time[k] = this.time[Math.round((k * (this.time.length - 1)) / Math.max(count - 1, 1))];
        this.pose(time[k]);
        link.updateWorldMatrix(true, false);
        link.localToWorld(point.fromArray(tip.xyz)).toArray(points, 3 * k);
      }
      const trail = new Trail(time, points, "measured");
      scene.add(trail.object);
      return [trail];
    }

    // Return the trail of each track (marker or frame) that has one, in the frame of the track.
    trailsOfTracks() {
      return this.tracks.filter((track) => track.trail).map((track) => {
        const points = new Float32Array(3 * track.time.length);
        for (let k = 0; k < track.time.length; k++) points.set(track.values.subarray(k * track.width, k * track.width + 3), 3 * k);
        const trail = new Trail(track.time, points, "marker");
        track.object.parent.add(trail.object);
        return trail;
      });
    }

    makeLink(link) {
      const group = new THREE.Group();
      group.name = link.name;
      for (const visual of link.visuals) {
        const [r, g, b, a] = visual.rgba, colour = new THREE.Color(r, g, b).multiplyScalar(0.86);
        const material = new THREE.MeshPhongMaterial({ color: colour, specular: 0x1a1a1a, side: THREE.DoubleSide, transparent: a < 1, opacity: a });
        group.add(place(new THREE.Mesh(geometryOf(visual), material), visual));
      }
      const axes = new THREE.AxesHelper(0.1);
      axes.visible = false;
      axes.userData.linkFrame = true;
      return group.add(axes);
    }

    // Set the poses of all parts at time t; joint positions are interpolated between instants.
    pose(t) {
      const [k, f] = between(this.time, t), n = this.columns, next = Math.min(k + 1, this.time.length - 1);
      for (const joint of this.joints) {
        const value = (1 - f) * this.position[k * n + joint.column] + f * this.position[next * n + joint.column];
        const q = joint.multiplier * value + joint.offset;
        if (joint.type === "prismatic") joint.child.position.copy(joint.axis).multiplyScalar(q);
        else joint.child.quaternion.setFromAxisAngle(joint.axis, q);
      }
      if (this.motion) {
        this.motion.show(t);
        this.root.position.copy(this.motion.object.position);
        this.root.quaternion.copy(this.motion.object.quaternion);
      }
      for (const moved of [...this.tracks, ...(this.plates || []), ...(this.arrows || []), ...(this.trails || [])]) moved.show(t);
      if (this.skin?.spec.touches.length) this.skin.show(t);
      if (this.lines) {
        this.root.updateWorldMatrix(true, true);
        this.lines.show(t);
      }
    }

    // Draw the contact shapes of a person with a skin through it, or the skin alone.
    showShapes(shown) {
      for (const mesh of this.meshes()) if (this.skin) mesh.visible = shown;
      if (this.skin) Object.assign(this.skin.object.material, { transparent: shown, opacity: shown ? 0.5 : 1 });
    }

    // Return the shapes of the links.
    meshes() {
      return [...this.links.values()].flatMap((link) => link.children.filter((o) => o.isMesh && !this.tracks.some((track) => track.object === o)));
    }

    // Colour the robots of several runs by run; all but the first are translucent.
    paint(several, behind) {
      for (const mesh of [...this.meshes(), ...(this.skin ? [this.skin.object] : [])]) {
        if (!several) break;
        if (mesh.isSkinnedMesh) mesh.material.vertexColors = false;
        mesh.material.color.set(report.colour(this.role));
        Object.assign(mesh.material, behind ? { transparent: true, opacity: 0.65, polygonOffset: true, polygonOffsetFactor: behind, polygonOffsetUnits: behind } : {});
      }
      for (const track of this.tracks) if (track.kind === "marker") track.object.material.color.set(report.colour(several ? this.role : "marker"));
      for (const trail of this.trails) trail.object.material.color.set(report.colour(several ? this.role : trail.role));
      for (const plate of this.plates) {
        plate.box.material.color.set(report.colour("plate"));
        plate.arrow.material.color.set(report.colour("limit"));
      }
      for (const arrow of this.arrows) arrow.material.color.set(report.colour(arrow.colour));
    }
  }

  // Contact forces of a running system by name, each an arrow that ends at its point.
  report.Forces = class {
    constructor(scene) {
      Object.assign(this, { scene, arrows: new Map() });
    }

    append(t, forces) {
      for (const { name } of forces) if (!this.arrows.has(name)) this.arrows.set(name, this.make(name));
      for (const [name, arrow] of this.arrows) {
        const { point, force } = forces.find((one) => one.name === name) || { point: [0, 0, 0], force: [0, 0, 0] };
        arrow.append(t, force, point);
      }
    }

    restart() {
      for (const arrow of this.arrows.values()) delete arrow.rows;
    }

    make(name) {
      const arrow = new Arrow({ name, per_newton: PER_NEWTON, ends: true, ...EMPTY() });
      arrow.material.color.set(report.colour("limit"));
      this.scene.add(arrow.object);
      return arrow;
    }

    show(t) {
      for (const arrow of this.arrows.values()) arrow.show(t);
    }
  };

  report.Robot = Robot;
  report.makeRobots = (scene) => report.data.scene.robots.map((spec) => new Robot(spec, scene));
}
