"use strict";
// The plots. Each is drawn when it comes into sight, with as many points as its width can show; a zoom shows the finer ones.
{
  const POINTS = 900, MARGIN = { l: 62, r: 14, t: 52, b: 40 }, ROW = 175, PAPER_ROW = 140, GAP = 0.07;
  const STROKES = { setpoint: { dash: "dash", width: 1.2 }, desired: { width: 2.6 }, raw: { width: 2.2 }, measured: { width: 1.3 } };

  // The part of a curve between two times, one point beyond each: as it is, or least and greatest of equal parts.
  const part = (curve, [begin, end]) => {
    const first = Math.max(0, report.countUntil(curve.time, begin) - 1);
    const last = Math.min(curve.time.length, report.countUntil(curve.time, end) + 1);
    if (last - first <= 2 * POINTS) return { x: curve.time.subarray(first, last), y: curve.values.subarray(first, last) };
    const x = [], y = [];
    for (let k = 0; k < POINTS; k++) {
      const a = first + Math.floor(((last - first) * k) / POINTS), b = first + Math.floor(((last - first) * (k + 1)) / POINTS);
      let low = a, high = a;
      for (let i = a + 1; i < b; i++) {
        if (!(curve.values[i] >= curve.values[low])) low = i;
        if (!(curve.values[i] <= curve.values[high])) high = i;
      }
      for (const i of low < high ? [low, high] : [high, low]) { x.push(curve.time[i]); y.push(curve.values[i]); }
    }
    return { x, y };
  };

  class PlotView {
    constructor(spec, parent) {
      this.spec = spec;
      this.drawn = false;
      this.stale = false;
      this.panels = spec.panels.map((panel) => ({
        ...panel, curves: panel.curves.map((curve) => ({ ...curve, time: report.read(curve.time), values: report.read(curve.values) })),
      }));
      this.columns = this.panels.length > 1 ? 2 : 1;
      this.rows = Math.ceil(this.panels.length / this.columns);
      const section = parent.appendChild(document.createElement("section"));
      section.className = "plot";
      section.id = "plot-" + spec.key;
      section.innerHTML = "<h3></h3><div class=canvas><div class=graph></div></div>";
      section.querySelector("h3").textContent = spec.title;
      this.frame = section.querySelector(".canvas");
      this.graph = section.querySelector(".graph");
      this.frame.style.minHeight = this.height + "px";
      this.cursors = Array.from({ length: this.columns }, () => {
        const line = this.frame.appendChild(document.createElement("div"));
        line.className = "cursor";
        return line;
      });
    }

    get height() {
      return MARGIN.t + MARGIN.b + (this.columns === 1 ? 320 : (report.paper ? PAPER_ROW : ROW) * this.rows);
    }

    domain(k) {
      const column = k % this.columns, row = Math.floor(k / this.columns), width = (1 - GAP * (this.columns - 1)) / this.columns;
      const gap = this.rows > 1 ? 0.3 / this.rows : 0, height = (1 - gap * (this.rows - 1)) / this.rows, top = 1 - row * (height + gap);
      return { x: [column * (width + GAP), column * (width + GAP) + width], y: [Math.max(0, top - height), top] };
    }

    traces() {
      const seen = new Set();
      return this.panels.flatMap((panel, k) => panel.curves.map((curve) => {
        const first = !seen.has(curve.name);
        seen.add(curve.name);
        const line = { color: report.colour(curve.role), width: 1.4, ...STROKES[curve.role] };
        const axes = { xaxis: "x" + (k ? k + 1 : ""), yaxis: "y" + (k ? k + 1 : "") };
        return { ...part(curve, this.range), ...axes, type: "scatter", mode: "lines", name: curve.name, legendgroup: curve.name, showlegend: first, line };
      }));
    }

    layout() {
      const text = report.colour("text"), line = report.colour("line"), names = new Set(this.panels.flatMap((panel) => panel.curves.map((c) => c.name)));
      const layout = {
        height: this.height, autosize: !report.paper, ...(report.paper ? { width: report.paper } : {}), margin: { ...MARGIN, autoexpand: false }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", hovermode: "x",
        font: { color: text, size: 11 }, showlegend: names.size > 1, legend: { orientation: "h", x: 0, y: 1, yanchor: "top", yref: "container", font: { size: 11 } },
        annotations: [], shapes: [], modebar: { bgcolor: "rgba(0,0,0,0)", color: report.colour("faint"), activecolor: report.colour("accent") }, hoverlabel: { bgcolor: report.colour("panel"), font: { color: text } },
      };
      this.panels.forEach((panel, k) => {
        const number = k ? k + 1 : "", { x, y } = this.domain(k), common = { gridcolor: line, zerolinecolor: line, linecolor: line, automargin: false };
        const title = (words) => ({ text: words, standoff: 4, font: { size: 10.5 } });
        const lowest = k + this.columns >= this.panels.length;
        layout["xaxis" + number] = { ...common, domain: x, anchor: "y" + number, range: [...this.range], ...(k ? { matches: "x" } : {}), ...(lowest ? { title: title(this.spec.timeTitle) } : {}) };
        const range = this.spec.logarithmic ? panel.range.map(Math.log10) : panel.range;
        const kind = this.spec.logarithmic ? { type: "log", exponentformat: "power", dtick: 2 } : {};
        layout["yaxis" + number] = { ...common, ...kind, domain: y, anchor: "x" + number, range, title: title(panel.unit), nticks: 6 };
        layout.annotations.push({ text: panel.title, xref: "paper", yref: "paper", x: x[0], y: y[1], xanchor: "left", yanchor: "bottom", showarrow: false, font: { size: 11.5 } });
        for (const [begin, end] of this.spec.bands) {
          const place = { xref: "x" + number, yref: "y" + number + " domain", x0: begin, x1: end, y0: 0, y1: 1 };
          layout.shapes.push({ type: "rect", ...place, fillcolor: report.colour("limit"), opacity: 0.12, line: { width: 0 } });
        }
        for (const bound of panel.bounds) {
          const place = { xref: "x" + number + " domain", yref: "y" + number, x0: 0, x1: 1, y0: bound, y1: bound };
          layout.shapes.push({ type: "line", ...place, line: { color: report.colour("limit"), width: 1.2, dash: "dot" } });
        }
      });
      return layout;
    }

    draw() {
      if (this.drawn && !this.stale) return;
      const begun = this.drawn;
      this.drawn = true;
      this.stale = false;
      this.range = report.range;
      this.frame.style.minHeight = this.height + "px";
      const buttons = [["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]]; // not the one that uploads
      const settings = { displaylogo: false, responsive: true, modeBarButtons: buttons, plotlyServerURL: "", doubleClick: false };
      Plotly.react(this.graph, this.traces(), this.layout(), settings);
      if (!begun) {
        this.graph.on("plotly_relayout", (change) => this.zoomed(change));
        this.graph.on("plotly_doubleclick", () => report.setRange([report.begin, report.end]));
        this.graph.on("plotly_click", (event) => report.setTime(event.points[0].x));
      }
      this.moveCursor();
    }

    zoomed(change) {
      if (Object.keys(change).some((key) => key.endsWith("autorange"))) report.setRange([report.begin, report.end]);
      else if (Object.keys(change).some((key) => key.startsWith("xaxis"))) report.setRange([...this.graph.layout.xaxis.range], this);
      else if ("autosize" in change) this.moveCursor();
    }

    // Another part of the time; the plot that was zoomed keeps its vertical axes.
    show(keep) {
      if (!this.drawn) return;
      if (!keep) { this.stale = true; if (this.inSight) this.draw(); return; }
      this.range = report.range;
      Plotly.react(this.graph, this.traces(), this.graph.layout);
      this.moveCursor();
    }

    moveCursor() {
      if (!this.drawn || !(this.inSight || report.paper)) return;
      const width = (report.paper || this.frame.clientWidth) - MARGIN.l - MARGIN.r, at = (report.time - this.range[0]) / (this.range[1] - this.range[0]);
      this.cursors.forEach((line, column) => {
        const [left, right] = this.domain(column).x, below = this.panels.length - column;
        const rows = Math.ceil(below / this.columns), bottom = this.domain(column + (rows - 1) * this.columns).y[0];
        line.style.display = at >= 0 && at <= 1 && rows > 0 ? "" : "none";
        line.style.left = MARGIN.l + width * (left + at * (right - left)) + "px";
        line.style.top = MARGIN.t + "px";
        line.style.height = (this.height - MARGIN.t - MARGIN.b) * (1 - bottom) + "px";
      });
    }
  }

  report.makePlots = (parent) => {
    report.plots = report.data.plots.map((spec) => new PlotView(spec, parent));
    const views = new Map(report.plots.map((view) => [view.frame, view]));
    const observer = new IntersectionObserver((entries) => entries.forEach((entry) => {
      const view = views.get(entry.target);
      view.inSight = entry.isIntersecting;
      if (view.inSight) { view.draw(); view.moveCursor(); }
    }), { rootMargin: "200px" });
    report.plots.forEach((view) => observer.observe(view.frame));
  };
  report.drawAll = () => report.plots.forEach((view) => { view.stale = true; view.draw(); });
}
