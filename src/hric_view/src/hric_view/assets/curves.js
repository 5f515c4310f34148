"use strict";
// Curves of chosen signals of a running system: the last seconds before the shown time, drawn on a canvas.
{
  const find = (id) => document.getElementById(id);
  const SPAN = 10, PERIOD = 100; // time that is shown [s]; shortest time between two drawings [ms]
  const HEIGHT = 110, LEFT = 52, POINTS = 400; // height of a plot and width of its labels [px]; most points of a curve
  const signals = new Map(); // by title: names of the curves, and the history of their values
  let asked = false, before = 0;

  const add = (title, t, values) => {
    let signal = signals.get(title);
    if (!signal) {
      signals.set(title, (signal = { names: [], history: new report.History(), plot: makePlot(title) }));
      choose(title, signal);
    }
    for (const name of Object.keys(values)) if (!signal.names.includes(name)) signal.names.push(name);
    signal.history.push(t, values);
  };

  const makePlot = (title) => {
    const figure = document.createElement("figure"), caption = document.createElement("figcaption"), canvas = document.createElement("canvas");
    caption.textContent = title;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", title);
    figure.append(caption, canvas);
    figure.hidden = true;
    find("curves").append(figure);
    return { figure, caption, canvas };
  };

  const choose = (title, { plot }) => {
    const label = document.createElement("label"), box = document.createElement("input");
    box.type = "checkbox";
    box.addEventListener("change", () => { plot.figure.hidden = !box.checked; ask(); });
    label.append(box, ` ${title}`);
    find("signals").append(label);
  };

  // Return the instants in the last seconds before t, thinned.
  const shown = ({ times, values }, t) => {
    const first = report.countUntil(times, t - SPAN), last = report.countUntil(times, t), step = Math.max(1, Math.ceil((last - first) / POINTS)), rows = [];
    for (let k = first; k < last; k += step) rows.push([times[k], values[k]]);
    return rows;
  };

  const draw = ({ names, history, plot: { caption, canvas } }, title, t) => {
    const rows = shown(history, t), ratio = window.devicePixelRatio, width = canvas.clientWidth;
    Object.assign(canvas, { width: width * ratio, height: HEIGHT * ratio });
    const pen = canvas.getContext("2d"), numbers = rows.flatMap(([, values]) => Object.values(values)).filter(Number.isFinite);
    pen.scale(ratio, ratio);
    pen.font = "11px system-ui, sans-serif";
    pen.fillStyle = report.colour("faint");
    if (!numbers.length) { pen.fillText("not known", LEFT, HEIGHT / 2); return; }
    const low = Math.min(...numbers), high = Math.max(...numbers), room = 0.05 * (high - low) || 1;
    const x = (time) => LEFT + ((time - t) / SPAN + 1) * (width - LEFT - 4), y = (value) => HEIGHT - 18 - ((value - low + room) / (high - low + 2 * room)) * (HEIGHT - 24);
    for (const value of [low, high]) pen.fillText(value.toPrecision(3), 2, y(value) + 4);
    pen.fillText(`${(t - SPAN).toFixed(1)} s`, LEFT, HEIGHT - 3);
    pen.fillText(`${t.toFixed(1)} s`, width - 40, HEIGHT - 3);
    names.forEach((name, k) => {
      pen.strokeStyle = report.colour(`s${k}`);
      pen.beginPath();
      let drawn = false;
      for (const [time, values] of rows) {
        const known = Number.isFinite(values[name]);
        if (known) pen[drawn ? "lineTo" : "moveTo"](x(time), y(values[name]));
        drawn = known;
      }
      pen.stroke();
    });
    const newest = rows[rows.length - 1][1];
    caption.replaceChildren(`${title}: `, ...names.map((name, k) => {
      const text = document.createElement("span");
      text.style.color = report.colour(`s${k}`);
      text.textContent = `${name} ${Number.isFinite(newest[name]) ? newest[name].toPrecision(3) : "not known"}  `;
      return text;
    }));
  };

  const drawAll = (now) => {
    if (now - before < PERIOD) { requestAnimationFrame(drawAll); return; }
    before = now;
    asked = false;
    for (const [title, signal] of signals) if (!signal.plot.figure.hidden) draw(signal, title, report.time);
  };

  const ask = () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(drawAll);
  };

  const named = (values, names) => Object.fromEntries(values.map((value, k) => [names[k], value]));

  report.parts.push((t, { robots, efforts, hand, forces, emg, plates }) => {
    const joints = report.data.scene.robots[0].joints.filter(({ column, multiplier }) => column !== null && multiplier === 1).sort((a, b) => a.column - b.column).map(({ name }) => name.replace(/^.*_/, ""));
    add("joint positions [rad, m]", t, named(robots[0].q, joints));
    if (efforts) add("efforts [N m, N]", t, named(efforts, joints));
    if (hand) add("external force [N]", t, named(hand.force, ["x", "y", "z"]));
    if (report.replay.robots.some(({ skin }) => skin)) add("contact force [N]", t, { largest: Math.max(0, ...(forces || []).map(({ force }) => Math.hypot(...force))) });
    if (emg) add("EMG envelope", t, emg);
    for (const { name, force } of plates || []) add(`${name} [N]`, t, named(force || [], ["x", "y", "z"]));
  });
  report.restarts.push(() => { for (const { history } of signals.values()) history.clear(); });
  report.on("scene", () => { for (const { history } of signals.values()) history.clear(); });
  report.timed.push(() => { if (report.live) ask(); });
}
