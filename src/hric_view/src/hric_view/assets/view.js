"use strict";
// Window: the scene of a running system or of a recorded run, and the time that is shown. Other scripts add parts to it
// by report.on() and report.timed.
{
  const find = (id) => document.getElementById(id);
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const FRAMED = 1; // time after which the view is chosen again, once [s]
  const OLD = 1000; // age from which on what is shown counts as old [ms]
  let live = true, framed = Infinity, lost = true, seen = [];

  report.begin = report.end = report.time = 0;
  report.timed ||= []; // called with the time after each change of it
  report.parts ||= []; // called with time and frame of each new instant of a running system
  report.restarts ||= []; // called when the time of the running system begins anew

  const setLive = (desired) => {
    live = desired;
    find("live").setAttribute("aria-pressed", desired);
    if (desired) { report.setPlaying(false); report.setTime(report.end); }
  };

  report.setTime = (t) => {
    report.time = Math.min(Math.max(t, report.begin), report.end);
    Object.assign(find("time"), { min: report.begin, max: report.end, value: report.time });
    find("now").textContent = report.fixed(report.time, 2) + " s";
    report.forces?.show(report.time);
    report.replay?.pose(report.time);
    for (const part of report.timed) part(report.time);
  };

  report.on("scene", (message) => {
    report.load(message.data, message.numbers);
    report.live = message.live;
    report.started = false;
    const times = message.live ? [] : report.data.scene.robots.map((robot) => report.read(robot.time)).filter((time) => time.length);
    report.begin = report.time = Math.min(...times.map((time) => time[0]), ...(times.length ? [] : [0]));
    report.end = Math.max(...times.map((time) => time[time.length - 1]), ...(times.length ? [] : [0]));
    const canvas = find("view").querySelector("canvas"), fresh = canvas.cloneNode();
    canvas.replaceWith(fresh); // a canvas has one renderer for good
    const seenFrom = message.live ? null : report.replay?.orbit;
    report.replay?.renderer.dispose();
    report.replay = report.makeReplay(fresh);
    if (seenFrom) for (const key of ["target", "distance", "azimuth", "elevation"]) report.replay.orbit[key] = seenFrom[key];
    paint();
    report.forces = report.replay && new report.Forces(report.replay.scene);
    lost = false;
    find("live").hidden = !message.live;
    find("link").textContent = message.live ? "connected; nothing has been received from the robot" : "";
    find("notes").textContent = report.data.notes.join("; ");
    live = message.live;
    report.setTime(report.begin);
    report.started = !message.live;
  });

  report.on("frame", (frame) => {
    const { t, robots, forces } = frame;
    seen = robots.map((robot, k) => (seen[k] && seen[k].t === robot.t ? seen[k] : { t: robot.t, at: performance.now() }));
    if (t === null || !report.replay || t === report.end) return;
    if (!report.started || t < report.end) { // the first instant, or a run that began anew
      report.begin = t;
      for (const part of [...report.replay.robots, report.forces]) part.restart();
      for (const restart of report.restarts) restart();
    }
    report.end = t;
    report.replay.robots.forEach((robot, k) => robot.append(t, robots[k]));
    report.forces.append(t, forces || []);
    for (const part of report.parts) part(t, frame);
    if (live) report.setTime(t); else Object.assign(find("time"), { max: t });
    if (!report.started || t > framed + FRAMED) { // by then all have sent something
      report.replay.home();
      framed = report.started ? Infinity : t;
    }
    report.started = true;
  });

  report.on("refused", ({ text }) => { find("link").textContent = "Refused: " + text; });

  report.on("sent", () => { if (find("link").textContent.startsWith("Refused")) find("link").textContent = ""; });

  report.on("lost", () => {
    lost = true;
    find("link").textContent = "The connection is lost: what is shown is old. Trying again.";
  });

  // Say what is old: a robot or person that sends nothing looks like one that stands still.
  const tellOld = () => {
    if (!report.live || !report.started || lost) return;
    const names = ["the arm", "the person"], old = names.filter((_, k) => k < seen.length && seen[k].t !== null && performance.now() - seen[k].at > OLD);
    if (old.length) find("link").textContent = `Nothing new from ${old.join(" and ")}: paused, or the connection is lost. What is shown is old.`;
    else if (!find("link").textContent.startsWith("Refused")) find("link").textContent = "";
  };

  const paint = () => {
    document.documentElement.dataset.theme = dark.matches ? "dark" : "light";
    report.replay?.paint();
    if (report.replay?.robots.some(({ label }) => label)) report.showLegend();
  };

  find("theme").hidden = true;
  find("live").addEventListener("click", () => setLive(!live));
  find("play").addEventListener("click", () => { if (!report.isPlaying()) setLive(false); report.setPlaying(!report.isPlaying()); });
  find("time").addEventListener("input", (event) => { setLive(false); report.setPlaying(false); report.setTime(Number(event.target.value)); });
  find("show-frames").addEventListener("change", (event) => report.replay?.showFrames(event.target.checked));
  find("show-tracks").addEventListener("change", () => report.replay?.pose(report.time));
  find("show-trails").addEventListener("change", () => report.replay?.pose(report.time));
  find("show-shapes").addEventListener("change", (event) => report.replay?.showShapes(event.target.checked));
  find("home").addEventListener("click", () => report.replay?.home());
  document.addEventListener("keydown", (event) => {
    if (event.key === " " && event.target === document.body) { event.preventDefault(); find("play").click(); }
  });
  dark.addEventListener("change", paint);
  paint();
  setInterval(tellOld, OLD / 2);
}
