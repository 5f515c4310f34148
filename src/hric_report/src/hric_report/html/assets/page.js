"use strict";
// Page of a run: current time, shared by plots, replay and events; light and dark theme; printing.
{
  const find = (id) => document.getElementById(id);
  const PAPER = 680; // width of a printed plot, within A4 and letter [CSS pixels]
  const THEMES = ["auto", "light", "dark"], dark = matchMedia("(prefers-color-scheme: dark)");
  let theme = "auto";

  const timeSpan = () => {
    const times = report.data.scene.robots.map((robot) => report.read(robot.time));
    if (!times.length) for (const plot of report.data.plots) if (!plot.equal) for (const panel of plot.panels) for (const curve of panel.curves) times.push(report.read(curve.time));
    const filled = times.filter((one) => one.length);
    return filled.length ? [Math.min(...filled.map((one) => one[0])), Math.max(...filled.map((one) => one[one.length - 1]))] : [0, 1];
  };

  report.setTime = (t) => {
    report.time = Math.min(Math.max(t, report.begin), report.end);
    find("time").value = report.time;
    find("now").textContent = report.fixed(report.time, 3) + " s";
    if (report.replay) report.replay.pose(report.time);
    for (const plot of report.plots) plot.moveCursor();
    for (const strip of strips) strip.moveCursor();
  };

  // Charts over time in the verdict: a line marks the time of the replay, and a click sets this time.
  const strips = [...document.querySelectorAll("svg.strip")].map((svg) => {
    const { left, width, begin, end } = Object.fromEntries(Object.entries(svg.dataset).map(([key, value]) => [key, Number(value)]));
    const line = svg.querySelector(".now");
    svg.addEventListener("click", (event) => {
      const box = svg.getBoundingClientRect(), x = ((event.clientX - box.left) / box.width) * width;
      if (x >= left) report.setTime(begin + ((end - begin) * (x - left)) / (width - left));
    });
    return {
      moveCursor: () => {
        const share = Math.min(Math.max((report.time - begin) / Math.max(end - begin, 1e-9), 0), 1), x = left + (width - left) * share;
        line.setAttribute("x1", x);
        line.setAttribute("x2", x);
      },
    };
  });

  report.setRange = (range, source) => {
    report.range = range;
    for (const plot of report.plots) plot.show(plot === source);
  };

  const paint = (printed = false) => {
    const isDark = !printed && (theme === "dark" || (theme === "auto" && dark.matches));
    report.paper = printed ? PAPER : 0;
    document.documentElement.dataset.theme = isDark ? "dark" : "light";
    find("theme").textContent = "theme: " + theme;
    if (report.replay) { report.replay.paint(); if (printed) report.replay.draw(); }
    if (printed) report.drawAll(); else for (const plot of report.plots) plot.show();
  };

  const connect = () => {
    find("time").addEventListener("input", (event) => { report.setPlaying(false); report.setTime(Number(event.target.value)); });
    find("play").addEventListener("click", () => report.setPlaying(!report.isPlaying()));
    find("theme").addEventListener("click", () => { theme = THEMES[(THEMES.indexOf(theme) + 1) % THEMES.length]; paint(); });
    dark.addEventListener("change", () => paint());
    find("show-frames").addEventListener("change", (event) => report.replay?.showFrames(event.target.checked));
    find("show-tracks").addEventListener("change", () => report.replay?.pose(report.time));
    find("show-trails").addEventListener("change", () => report.replay?.pose(report.time));
    find("show-shapes").addEventListener("change", (event) => report.replay?.showShapes(event.target.checked));
    find("all").addEventListener("click", () => report.setRange([report.begin, report.end]));
    find("home").addEventListener("click", () => report.replay?.home());
    document.querySelectorAll("tr.event").forEach((row) => row.addEventListener("click", () => report.setTime(Number(row.dataset.time))));
    document.querySelectorAll(".jump").forEach((one) => {
      const jump = (event) => { event.stopPropagation(); event.preventDefault(); report.setPlaying(false); report.setTime(Number(one.dataset.time)); };
      one.addEventListener("click", jump);
      one.addEventListener("keydown", (event) => { if (event.key === "Enter" || event.key === " ") jump(event); });
    });
    document.addEventListener("keydown", (event) => {
      if (event.key === " " && event.target === document.body) { event.preventDefault(); report.setPlaying(!report.isPlaying()); }
    });
    const open = [];
    window.addEventListener("beforeprint", () => {
      document.querySelectorAll("details:not([open])").forEach((one) => { one.open = true; open.push(one); });
      paint(true);
    });
    window.addEventListener("afterprint", () => { open.splice(0).forEach((one) => { one.open = false; }); paint(); });
  };

  [report.begin, report.end] = timeSpan();
  report.time = report.begin;
  report.range = [report.begin, report.end];
  Object.assign(find("time"), { min: report.begin, max: report.end });
  document.documentElement.dataset.theme = dark.matches ? "dark" : "light";
  report.makePlots();
  report.replay = report.makeReplay(document.querySelector("#view canvas"));
  if (report.replay) report.showLegend();
  connect();
  report.setTime(report.begin);
  report.ready = true;
}
