"use strict";
// Columns of the sweep's table: values, axis scales, and the selection of runs that are shown.
const sweep = { brushes: new Map(), hidden: new Set(), ids: document.getElementById("ids").textContent.trim().split(" ") };
{
  const { data } = report, KINDS = ["fine", "exceeded", "failed"];
  sweep.KINDS = KINDS;
  sweep.kinds = report.read(data.kinds);
  sweep.index = report.read(data.index);
  // Weight of each run in a distribution; null: all runs have equal weight.
  sweep.counts = data.counts && report.read(data.counts);
  sweep.count = sweep.kinds.length;
  sweep.shown = new Uint8Array(sweep.count).fill(1);

  sweep.rgb = (colour) => {
    const pencil = document.createElement("canvas").getContext("2d");
    pencil.fillStyle = colour;
    return [1, 3, 5].map((at) => parseInt(pencil.fillStyle.slice(at, at + 2), 16));
  };
  sweep.colours = () => [report.colour("line"), report.colour("measured"), report.colour("desired"), report.colour("limit")];
  sweep.STRENGTH = [0.55, 0.9, 0.95, 1];
  // Drawing order from bottom to top: runs outside the selection, runs without fault, failed runs, runs beyond the limit.
  sweep.layer = (row) => (sweep.shown[row] ? [1, 3, 2][sweep.kinds[row]] : 0);

  // Text of a number, with about four significant digits.
  sweep.text = (value) => {
    if (Number.isNaN(value)) return "none";
    if (!Number.isFinite(value)) return value > 0 ? "infinite" : "minus infinite";
    const size = Math.abs(value);
    if (size !== 0 && (size < 1e-3 || size >= 1e5)) return value.toExponential(2).replace(/\.?0*e\+?/, "e");
    return String(Number(value.toPrecision(4)));
  };

  const ticks = (low, high, count) => {
    const rough = (high - low) / count, power = 10 ** Math.floor(Math.log10(rough)), part = rough / power;
    const step = power * (part > 5 ? 10 : part > 2 ? 5 : part > 1 ? 2 : 1), marks = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) marks.push(k * step);
    return marks;
  };

  // Tick values of a logarithmic axis: powers of ten, and also their multiples by 2 and 5 if there are only few powers.
  const decades = (low, high, count) => {
    const marks = [], few = Math.log10(high / low) < count / 2;
    for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power++) {
      for (const part of few ? [1, 2, 5] : [1]) marks.push(Number(`${part}e${power}`));
    }
    return marks;
  };

  class Column {
    constructor(spec) {
      Object.assign(this, spec, { values: report.read(spec.values) });
      let low = Infinity, high = -Infinity;
      this.gaps = false;
      for (const value of this.values) {
        if (Number.isNaN(value)) { this.gaps = true; continue; }
        if (!Number.isFinite(value)) continue;
        if (value < low) low = value;
        if (value > high) high = value;
      }
      if (low > high) [low, high] = [0, 1];
      if (low === high) { const half = this.labels.length ? 0.5 : Math.abs(low) * 0.05 || 0.5; low -= half; high += half; }
      this.ends = this.log ? [Math.log(low), Math.log(high)] : [low, high];
      this.shares = Float32Array.from(this.values, (value) => this.share(value));
    }

    // Relative position of a value on the axis, 0 to 1; infinite values lie at an end; -1: no value.
    share(value) {
      if (Number.isNaN(value)) return -1;
      if (!Number.isFinite(value)) return value > 0 ? 1 : 0;
      return ((this.log ? Math.log(value) : value) - this.ends[0]) / (this.ends[1] - this.ends[0]);
    }

    value(share) {
      const position = this.ends[0] + share * (this.ends[1] - this.ends[0]);
      return this.log ? Math.exp(position) : position;
    }

    // Ticks of the axis: [relative position, text].
    ticks(count) {
      if (this.labels.length) return this.labels.map((label, k) => [this.share(k), label]);
      const [low, high] = this.ends;
      const marks = this.log ? decades(Math.exp(low), Math.exp(high), count) : ticks(low, high, count);
      return marks.map((value) => [this.share(value), sweep.text(value)]).filter(([share]) => share >= -1e-6 && share <= 1 + 1e-6);
    }

    valueText(row) {
      const value = this.values[row];
      if (this.labels.length) return this.labels[value] ?? "none";
      return sweep.text(value) + (this.unit && Number.isFinite(value) ? " " + this.unit : "");
    }
  }
  sweep.columns = data.columns.map((spec) => new Column(spec));

  // Select the runs that are within all brushes (ranges dragged on axes) and of a kind that is switched on.
  sweep.filter = () => {
    const { shown, kinds, hidden } = sweep, off = KINDS.map((kind) => hidden.has(kind));
    for (let row = 0; row < sweep.count; row++) shown[row] = off[kinds[row]] ? 0 : 1;
    for (const [name, [low, high]] of sweep.brushes) {
      const column = sweep.columns.find((each) => each.name === name);
      if (!column) continue;
      const { shares } = column;
      for (let row = 0; row < sweep.count; row++) if (!(shares[row] >= low && shares[row] <= high)) shown[row] = 0;
    }
    sweep.left = shown.reduce((sum, flag) => sum + flag, 0);
  };

  const NAMES = "http://www.w3.org/2000/svg";
  sweep.svg = (parent, tag, attributes, text) => {
    const made = document.createElementNS(NAMES, tag);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    if (text !== undefined) made.textContent = text;
    parent.append(made);
    return made;
  };
  // Text, shortened so that it is about no wider than `width` [CSS pixels].
  sweep.short = (text, width, perLetter = 6.6) => {
    const most = Math.max(3, Math.floor(width / perLetter));
    return text.length <= most ? text : text.slice(0, most - 1) + "…";
  };
}
