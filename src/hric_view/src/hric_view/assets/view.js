"use strict";
// Window: the scene of a running system, whose instants arrive by a WebSocket and are kept for a look back.
{
  const find = (id) => document.getElementById(id);
  const AGAIN = 1000; // wait until the next try to connect [ms]
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const FRAMED = 1; // time after which the view is chosen again, once [s]
  const OLD = 1000; // age from which on what is shown counts as old [ms]
  let live = true, framed = Infinity, lost = true, seen = [];

  report.begin = report.end = report.time = 0;

  const setLive = (desired) => {
    live = desired;
    find("live").setAttribute("aria-pressed", desired);
    if (desired) setTime(report.end);
  };

  const setTime = (t) => {
    report.time = t;
    Object.assign(find("time"), { min: report.begin, max: report.end, value: t });
    find("now").textContent = t.toFixed(2) + " s";
    report.forces?.show(t);
    report.replay?.pose(t);
  };

  const showScene = ({ data, numbers }) => {
    report.load(data, numbers);
    report.begin = report.end = report.time = 0;
    report.started = false;
    const canvas = find("view").querySelector("canvas"), fresh = canvas.cloneNode();
    canvas.replaceWith(fresh); // a canvas has one renderer for good
    report.replay?.renderer.dispose();
    report.replay = report.makeReplay(fresh);
    report.forces = report.replay && new report.Forces(report.replay.scene);
    if (data.notes.length) find("view-note").textContent = data.notes.join("; ");
  };

  const showFrame = ({ t, robots, forces }) => {
    seen = robots.map((robot, k) => (seen[k] && seen[k].t === robot.t ? seen[k] : { t: robot.t, at: performance.now() }));
    if (t === null || !report.replay || t === report.end) return;
    if (!report.started || t < report.end) { // the first instant, or a run that began anew
      report.begin = t;
      for (const robot of report.replay.robots) delete robot.rows;
    }
    report.end = t;
    report.replay.robots.forEach((robot, k) => robot.append(t, robots[k]));
    report.forces.append(t, forces || []);
    if (live) setTime(t); else Object.assign(find("time"), { max: t });
    if (!report.started || t > framed + FRAMED) { // by then all have been heard of
      report.replay.home();
      framed = report.started ? Infinity : t;
    }
    report.started = true;
  };

  // Say what is old: a robot or person that sends nothing looks like one that stands still.
  const tellOld = () => {
    if (!report.started || lost) return;
    const names = ["the arm", "the person"], old = names.filter((_, k) => k < seen.length && performance.now() - seen[k].at > OLD);
    find("link").textContent = old.length ? `Nothing new from ${old.join(" and ")}: paused, or the connection is lost. What is shown is old.` : "";
  };

  const connect = () => {
    const socket = new WebSocket(`ws://${location.host}/socket${location.search}`);
    socket.addEventListener("message", (event) => {
      const message = JSON.parse(event.data);
      if ("data" in message) showScene(message); else showFrame(message);
      lost = false;
      if (!report.started) find("link").textContent = "connected; nothing has been received from the robot";
    });
    socket.addEventListener("close", () => {
      lost = true;
      find("link").textContent = "The connection is lost: what is shown is old. Trying again.";
      setTimeout(connect, AGAIN);
    });
  };

  const paint = () => {
    document.documentElement.dataset.theme = dark.matches ? "dark" : "light";
    report.replay?.paint();
  };

  find("theme").hidden = true;
  find("live").addEventListener("click", () => setLive(!live));
  find("time").addEventListener("input", (event) => { setLive(false); setTime(Number(event.target.value)); });
  find("show-frames").addEventListener("change", (event) => report.replay?.showFrames(event.target.checked));
  find("show-shapes").addEventListener("change", (event) => report.replay?.showShapes(event.target.checked));
  find("home").addEventListener("click", () => report.replay?.home());
  dark.addEventListener("change", paint);
  paint();
  setInterval(tellOld, OLD / 2);
  connect();
}
