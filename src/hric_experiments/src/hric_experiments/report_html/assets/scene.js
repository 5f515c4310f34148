"use strict";
// The robots: links as groups that joints move, and markers and frames that move by themselves. z is up.
{
  const LOST = 0.25; // a marker that was not seen for so long is not drawn [s]
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
    return new THREE.CylinderGeometry(radius, radius, length, 32).rotateX(Math.PI / 2); // URDF: along z
  };

  const place = (object, { xyz, quaternion }) => {
    object.position.fromArray(xyz);
    object.quaternion.fromArray(quaternion);
    return object;
  };

  // Index of the last instant at or before t, and how far t is towards the next one.
  const between = (times, t) => {
    const k = Math.min(Math.max(report.countUntil(times, t) - 1, 0), Math.max(times.length - 2, 0));
    const step = k + 1 < times.length ? times[k + 1] - times[k] : 0;
    return [k, step > 0 ? Math.min(Math.max((t - times[k]) / step, 0), 1) : 0, step];
  };

  class Track {
    constructor(spec) {
      Object.assign(this, spec, { time: report.read(spec.time), values: report.read(spec.values) });
      this.object = spec.kind === "marker" ? new THREE.Mesh(new THREE.SphereGeometry(0.009, 16, 12), new THREE.MeshLambertMaterial()) : new THREE.AxesHelper(0.12);
      this.object.name = spec.name;
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
      for (const name of roots) scene.add(this.links.get(name));
      const root = this.links.get([...roots][0]);
      this.tracks = spec.tracks.map((track) => new Track(track));
      for (const track of this.tracks) (this.links.get(track.parent) || root).add(track.object);
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

    // Joints between two instants are interpolated.
    pose(t) {
      const [k, f] = between(this.time, t), n = this.columns, next = Math.min(k + 1, this.time.length - 1);
      for (const joint of this.joints) {
        const value = (1 - f) * this.position[k * n + joint.column] + f * this.position[next * n + joint.column];
        const q = joint.multiplier * value + joint.offset;
        if (joint.type === "prismatic") joint.child.position.copy(joint.axis).multiplyScalar(q);
        else joint.child.quaternion.setFromAxisAngle(joint.axis, q);
      }
      for (const track of this.tracks) track.show(t);
    }

    // Robots of several runs are told apart by colour; the first is as it is, the others can be seen through.
    paint(several, behind) {
      for (const link of this.links.values()) link.children.filter((o) => o.isMesh && !this.tracks.some((track) => track.object === o)).forEach((mesh) => {
        if (!several) return;
        mesh.material.color.set(report.colour(this.role));
        Object.assign(mesh.material, behind ? { transparent: true, opacity: 0.65, polygonOffset: true, polygonOffsetFactor: behind, polygonOffsetUnits: behind } : {});
      });
      for (const track of this.tracks) if (track.kind === "marker") track.object.material.color.set(report.colour(several ? this.role : "marker"));
    }
  }

  report.makeRobots = (scene) => report.data.scene.robots.map((spec) => new Robot(spec, scene));
}
