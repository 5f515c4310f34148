"use strict";
// 3D replay of the run: camera, lights, ground, and redrawing after changes.
{
  const NEAR = 0.02, FAR = 60, FIELD = 40; // near and far end of the view [m], and its vertical angle [deg]
  const AZIMUTH = 0.9, ELEVATION = 0.3, MARGIN = 1.04; // first direction of the view [rad], and distance over the smallest one that shows all

  // Camera that orbits a point, z up: drag rotates, shift-drag or the right button pans, the wheel zooms.
  class Orbit {
    constructor(camera, canvas, changed) {
      Object.assign(this, { camera, target: new THREE.Vector3(), distance: 2.5, azimuth: AZIMUTH, elevation: ELEVATION });
      canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
      canvas.addEventListener("contextmenu", (event) => event.preventDefault());
      canvas.addEventListener("pointermove", (event) => {
        if (!event.buttons) return;
        if (event.shiftKey || event.buttons > 1) this.move(event.movementX / canvas.clientHeight, event.movementY / canvas.clientHeight);
        else this.turn(event.movementX, event.movementY);
        changed();
      });
      canvas.addEventListener("wheel", (event) => {
        event.preventDefault();
        this.distance = Math.min(Math.max(this.distance * Math.exp(event.deltaY * 1e-3), 0.1), 20);
        changed();
      }, { passive: false });
    }

    turn(x, y) {
      this.azimuth -= 0.008 * x;
      this.elevation = Math.min(Math.max(this.elevation + 0.008 * y, -1.5), 1.5);
    }

    move(x, y) {
      const right = new THREE.Vector3().setFromMatrixColumn(this.camera.matrix, 0), up = new THREE.Vector3().setFromMatrixColumn(this.camera.matrix, 1);
      this.target.addScaledVector(right, -x * this.distance).addScaledVector(up, y * this.distance);
    }

    apply() {
      const flat = Math.cos(this.elevation);
      const from = new THREE.Vector3(flat * Math.cos(this.azimuth), flat * Math.sin(this.azimuth), Math.sin(this.elevation));
      this.camera.position.copy(this.target).addScaledVector(from, this.distance);
      this.camera.lookAt(this.target);
    }
  }

  class Replay {
    constructor(canvas, context) {
      this.canvas = canvas;
      this.renderer = new THREE.WebGLRenderer({ canvas, context, antialias: true });
      this.scene = new THREE.Scene();
      this.camera = new THREE.PerspectiveCamera(FIELD, 1, NEAR, FAR);
      this.camera.up.set(0, 0, 1);
      this.orbit = new Orbit(this.camera, canvas, () => this.ask());
      this.light = new THREE.DirectionalLight(0xffffff, 0.55);
      this.scene.add(new THREE.HemisphereLight(0xffffff, 0x606870, 0.6), this.light);
      this.robots = report.makeRobots(this.scene);
      new ResizeObserver(() => this.ask()).observe(canvas.parentElement);
      this.paint();
      this.home();
      this.showShapes(false);
      if (this.robots.some(({ skin }) => skin)) document.querySelectorAll(".of-skin").forEach((element) => { element.hidden = false; });
    }

    // Reset the view: it shows all positions of the robots between two times, by default of the whole run.
    home(begin = report.begin, end = report.end, azimuth = AZIMUTH, elevation = ELEVATION) {
      Object.assign(this.orbit, { azimuth, elevation });
      const points = [], add = (object) => points.push(new THREE.Vector3().setFromMatrixPosition(object.matrixWorld));
      const enclose = (mesh) => {
        mesh.geometry.boundingBox || mesh.geometry.computeBoundingBox();
        const { min, max } = mesh.geometry.boundingBox;
        for (const x of [min.x, max.x]) for (const y of [min.y, max.y]) for (const z of [min.z, max.z]) points.push(mesh.localToWorld(new THREE.Vector3(x, y, z)));
      };
      for (let k = 0; k <= 8; k++) {
        this.pose(begin + ((end - begin) * k) / 8);
        this.scene.updateMatrixWorld(true);
        for (const robot of this.robots) {
          robot.tracks.filter(({ object }) => object.visible).forEach(({ object }) => add(object));
          robot.plates.forEach((plate) => enclose(plate.box));
          robot.links.forEach(add);
          robot.meshes().forEach(enclose);
        }
      }
      if (points.length) this.fit(points);
      this.pose(report.time);
    }

    // Look at points from the present direction, so that they fill the picture.
    fit(points) {
      const { orbit, camera } = this, { clientWidth, clientHeight } = this.canvas.parentElement;
      const tall = Math.tan((0.5 * FIELD * Math.PI) / 180), wide = (tall * clientWidth) / Math.max(clientHeight, 1);
      new THREE.Box3().setFromPoints(points).getCenter(orbit.target);
      for (let round = 0; round < 3; round++) {
        orbit.apply();
        camera.updateMatrixWorld();
        const seen = points.map((point) => point.clone().applyMatrix4(camera.matrixWorldInverse));
        orbit.distance = MARGIN * Math.max(...seen.map(({ x, y, z }) => z + orbit.distance + Math.max(Math.abs(x) / wide, Math.abs(y) / tall)));
        const { min, max } = new THREE.Box3().setFromPoints(seen.map(({ x, y, z }) => new THREE.Vector3(x / -z, y / -z, 0)));
        for (const [k, middle] of [(min.x + max.x) / 2, (min.y + max.y) / 2].entries()) {
          if (round < 2 && seen.every(({ z }) => z < -NEAR)) orbit.target.addScaledVector(new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, k), middle * orbit.distance);
        }
      }
    }

    // Prepare pictures of this size [px], seen from a direction [rad], of all positions between two times.
    film({ width, height, azimuth, elevation, begin, end }) {
      Object.assign(this.canvas.parentElement.style, { position: "fixed", inset: "0", border: "0", borderRadius: "0", zIndex: "20", width: width + "px", height: height + "px" });
      this.home(begin, end, azimuth, elevation);
    }

    // Return the picture at time t as a PNG in base64.
    picture(t) {
      this.asked = true; // drawn here, not at the next screen refresh
      this.pose(t);
      this.draw();
      return this.canvas.toDataURL("image/png").split(",")[1];
    }

    pose(t) {
      for (const robot of this.robots) robot.pose(t);
      const shown = document.getElementById("show-tracks").checked;
      const trails = document.getElementById("show-trails").checked;
      for (const robot of this.robots) {
        if (!shown) for (const track of robot.tracks) track.object.visible = false;
        if (!trails) for (const trail of robot.trails) trail.object.visible = false;
      }
      this.ask();
    }

    showShapes(shown) {
      for (const robot of this.robots) robot.showShapes(shown);
      this.ask();
    }

    showFrames(shown) {
      this.scene.traverse((object) => { if (object.userData.linkFrame) object.visible = shown; });
      this.ask();
    }

    paint() {
      this.scene.background = new THREE.Color(report.colour("panel"));
      if (this.grid) this.scene.remove(this.grid);
      this.grid = new THREE.GridHelper(4, 16, report.colour("ground"), report.colour("ground")).rotateX(Math.PI / 2);
      this.scene.add(this.grid);
      const roles = [...new Set(this.robots.map(({ role }) => role))]; // a human has the same role (colour) as the robot of its run
      for (const robot of this.robots) robot.paint(roles.length > 1, roles.indexOf(robot.role));
      this.ask();
    }

    // Request a drawing at the next screen refresh.
    ask() {
      if (this.asked) return;
      this.asked = true;
      requestAnimationFrame(() => this.draw());
    }

    draw() {
      this.asked = false;
      if (!this.canvas.isConnected) return; // another scene has replaced it since the request
      const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
      this.renderer.setPixelRatio(window.devicePixelRatio);
      this.renderer.setSize(width, height, false);
      this.camera.aspect = width / Math.max(height, 1);
      this.camera.updateProjectionMatrix();
      this.orbit.apply();
      this.light.position.copy(this.camera.position).add(new THREE.Vector3(0, 0, 1.5)).addScaledVector(new THREE.Vector3().setFromMatrixColumn(this.camera.matrix, 0), 1.5);
      this.renderer.render(this.scene, this.camera);
    }
  }

  // Return the replay; null without WebGL: the page then lacks only the replay.
  report.makeReplay = (canvas) => {
    const context = report.data.scene.robots.length ? canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true }) : null;
    if (context) return new Replay(canvas, context);
    document.getElementById("view-note").textContent = report.data.scene.robots.length ? "No replay: this browser does not support WebGL 2." : "No replay in this run.";
    return null;
  };

  // Say below the picture what is drawn; of several runs in the colour of each.
  report.showLegend = () => {
    const words = [], several = report.replay.robots.some(({ label }) => label);
    for (const robot of report.replay.robots) {
      const count = (kind) => robot.tracks.filter((track) => track.kind === kind);
      const frames = count("frame").map((track) => track.name), markers = count("marker").length;
      const line = document.createElement("span");
      const trails = robot.trails.map(({ role }) => (role === "marker" ? "marker (orange)" : "end effector (blue)"));
      line.textContent = [several ? robot.label : "", markers ? markers + " markers" : "", frames.length ? "frames: " + frames.join(", ") : "", robot.plates.map((plate) => plate.object.name).join(", "), robot.arrows.map(({ name }) => name).join(", "), robot.lines ? robot.lines.title + ", coloured as in its plot" : "", trails.length && !several ? "trails of 8 s: " + [...new Set(trails)].join(", ") : ""].filter(Boolean).join("; ");
      if (several) line.style.color = report.colour(robot.role);
      if (line.textContent) words.push(line, document.createElement("br"));
    }
    document.getElementById("view-legend").replaceChildren(...words);
  };
}
