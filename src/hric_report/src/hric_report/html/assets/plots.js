"use strict";
// Plots. A plot is drawn when it becomes visible, with as many points as its width can show; zooming shows more points.
// A picture for a paper is the same plot in light colours, with the width of a journal column.
{
  const POINTS = 900, PIXELS_PER_MM = 96 / 25.4, DOTS_PER_INCH = 300;
  const SCREEN = { margin: { l: 64, r: 14, t: 12, b: 42 }, title: 16, row: 138, alone: 300, cell: 13, gap: 66, between: 44, font: 11, line: 1.35 };
  const PRINTED = { ...SCREEN, row: 105 };
  const PAPER = { margin: { l: 48, r: 9, t: 8, b: 33 }, title: 12, row: 88, alone: 190, cell: 10.5, gap: 50, between: 30, font: 9.5, line: 1.25, legend: 14 };
  const FAMILY = "Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif";

  // Return the points of a curve between two times, and one point beyond each; of a long curve only minima and maxima of equal parts.
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

  // Return the Plotly trace of a heat map; its values are stored row by row in one array.
  const heatTrace = ({ rows, unit, scale, time, values }, look) => {
    const n = time.length, top = scale[scale.length - 1][0], title = { text: unit, side: "right", font: { size: look.font } };
    return {
      type: "heatmap", x: time, y: rows.map((_, k) => k), z: rows.map((_, k) => values.subarray(k * n, k * n + n)), zmin: 0, zmax: top, name: "",
      colorscale: scale.map(([value, colour]) => [value / top, colour]), colorbar: { title, thickness: 9, outlinewidth: 0, xpad: 8, len: 1, lenmode: "fraction" },
      text: rows.map((row) => Array(n).fill(row)), hovertemplate: "%{text}: %{z:.3f}, %{x:.3f} s<extra></extra>", xaxis: "x", yaxis: "y",
    };
  };

  const dash = (role, width) => (role.dash.length ? role.dash.map((length) => length * width + "px").join(",") : "solid");

  class PlotView {
    constructor(spec, section) {
      Object.assign(this, { spec, drawn: false, stale: false, hidden: new Set() });
      this.panels = spec.panels.map((panel) => ({
        ...panel, curves: panel.curves.map((curve) => ({ ...curve, time: report.read(curve.time), values: report.read(curve.values) })),
        heat: panel.heat && { ...panel.heat, time: report.read(panel.heat.time), values: report.read(panel.heat.values) },
      }));
      this.heat = this.panels[0].heat; // a figure with a heat map has only one panel
      this.names = new Map();
      for (const panel of this.panels) for (const curve of panel.curves) if (!this.names.has(curve.name)) this.names.set(curve.name, curve.role);
      this.frame = section.querySelector(".canvas");
      this.graph = section.querySelector(".graph");
      this.makeLegend(section.querySelector(".legend"));
      section.querySelectorAll(".save button").forEach((button) => button.addEventListener("click", () => this.save(button.dataset.format, Number(button.dataset.width))));
      this.frame.style.minHeight = this.geometry().height + "px";
      this.cursors = !spec.timed ? [] : this.panels.map(() => {
        const line = this.frame.appendChild(document.createElement("div"));
        line.className = "cursor";
        return line;
      });
    }

    // Add the legend above the graph, so that it hides no curve; a click on an entry hides its curve.
    makeLegend(parent) {
      const entries = [...this.names].map(([name, role]) => {
        const entry = document.createElement("button"), swatch = entry.appendChild(document.createElement("i")), look = report.data.roles[role];
        entry.append(name);
        entry.type = "button";
        Object.assign(swatch.style, { borderTop: `${look.width ? Math.max(1.5, 1.5 * look.width) : 3}px ${look.dash.length ? "dashed" : look.width ? "solid" : "dotted"} var(--${role})`, opacity: look.opacity });
        entry.addEventListener("click", () => {
          if (!this.hidden.delete(name)) this.hidden.add(name);
          entry.classList.toggle("off", this.hidden.has(name));
          this.stale = true;
          this.draw();
        });
        return entry;
      });
      for (const name of new Set(this.spec.bands.map((band) => band[0]))) {
        const entry = document.createElement("span"), swatch = entry.appendChild(document.createElement("i"));
        swatch.className = "band";
        entry.append(name);
        entries.push(entry);
      }
      if (entries.length > 1) parent.append(...entries);
    }

    // Return sizes and positions of the panels [pixels]; mm: width of a picture for a paper [mm]; undefined: layout of the page.
    geometry(mm) {
      const look = mm ? PAPER : report.paper ? PRINTED : SCREEN, width = mm ? mm * PIXELS_PER_MM : report.paper || this.frame.clientWidth || 800;
      const columns = Math.min(this.spec.columns, this.panels.length, width < 500 ? (this.spec.equal ? 1 : 2) : 3), rows = Math.ceil(this.panels.length / columns);
      const { l, r, t, b } = this.heat ? this.heatMargin(look) : look.margin, legend = mm ? this.legendRows(width - l - r, look) : [];
      const top = t + legend.length * (look.legend || 0) + (this.panels.some((panel) => panel.title) ? look.title : 0);
      const wide = (width - l - r - look.gap * (columns - 1)) / columns, high = this.heat ? this.heat.rows.length * look.cell : this.spec.equal ? Math.min(wide, 340) : rows > 1 ? look.row : look.alone;
      const inner = { width: width - l - r, height: rows * high + (rows - 1) * look.between };
      const domain = (k) => {
        const x = (k % columns) * (wide + look.gap), y = Math.floor(k / columns) * (high + look.between);
        return { x: [x / inner.width, (x + wide) / inner.width], y: [Math.max(0, 1 - (y + high) / inner.height), 1 - y / inner.height] };
      };
      return { look, legend, width, columns, rows, inner, domain, margin: { l, r, t: top, b }, height: top + b + inner.height };
    }

    // Return margins with space for the names of the rows and for the colour scale.
    heatMargin(look) {
      return { ...look.margin, l: 14 + 0.56 * (look.font - 1) * Math.max(...this.heat.rows.map((row) => row.length)), r: 62 };
    }

    // Return the entries of a picture's legend, row by row: [name, role, left].
    legendRows(width, look) {
      if (this.names.size < 2) return [];
      const rows = [[]];
      let left = 0;
      for (const [name, role] of this.names) {
        const wide = 30 + 0.56 * look.font * name.length;
        if (left && left + wide > width) { rows.push([]); left = 0; }
        rows[rows.length - 1].push([name, role, left]);
        left += wide;
      }
      return rows;
    }

    traces(look, range) {
      if (this.heat) return [heatTrace(this.heat, look)];
      return this.panels.flatMap((panel, k) => panel.curves.map((curve) => {
        const role = report.data.roles[curve.role], width = Math.max(role.width, 0.1) * look.line;
        const drawn = role.width ? { mode: "lines", line: { color: report.colour(curve.role), width, dash: dash(role, width), simplify: false } } : { mode: "markers", marker: { color: report.colour(curve.role), size: 2.5 } };
        const axes = { xaxis: "x" + (k ? k + 1 : ""), yaxis: "y" + (k ? k + 1 : "") };
        const points = !this.spec.timed ? { x: curve.time, y: curve.values } : part(curve, range);
        return { ...points, ...axes, ...drawn, type: "scatter", name: curve.name, opacity: role.opacity, visible: !this.hidden.has(curve.name) };
      }));
    }

    layout(shape, range) {
      const { look, domain, columns, margin, height, inner } = shape, text = report.colour("text"), line = report.colour("line");
      const layout = {
        height, margin: { ...margin, autoexpand: false }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", hovermode: this.spec.equal || this.heat ? "closest" : "x",
        font: { color: text, size: look.font, family: FAMILY }, showlegend: false, annotations: [], shapes: [], hoverlabel: { bgcolor: report.colour("panel"), font: { color: text } },
      };
      const words = (string, place, size = look.font, colour = text) => layout.annotations.push({ text: string, showarrow: false, xanchor: "left", yanchor: "bottom", font: { size, color: colour }, borderpad: 0, ...place });
      this.panels.forEach((panel, k) => {
        const number = k ? k + 1 : "", { x, y } = domain(k), common = { gridcolor: line, zerolinecolor: line, linecolor: text, showline: true, ticks: "outside", ticklen: 3, automargin: false };
        const title = (string) => ({ text: string, standoff: 4, font: { size: look.font } });
        const lowest = k + columns >= this.panels.length, ends = !this.spec.timed ? { range: panel.xrange } : { range: [...range], ...(k ? { matches: "x" } : {}) };
        layout["xaxis" + number] = { ...common, ...ends, domain: x, anchor: "y" + number, nticks: Math.max(3, Math.round((x[1] - x[0]) * inner.width / 60)), showticklabels: lowest, ...(lowest ? { title: title(panel.abscissa) } : {}) };
        const vertical = this.spec.logarithmic ? { range: panel.range.map(Math.log10), type: "log", exponentformat: "power", dtick: 2 } : { range: panel.range };
        layout["yaxis" + number] = { ...common, ...vertical, domain: y, anchor: "x" + number, nticks: 6, ...(k % columns === 0 || panel.own ? { title: title(panel.unit) } : {}) };
        if (panel.heat) Object.assign(layout.yaxis, { tickvals: panel.heat.rows.map((_, row) => row), ticktext: panel.heat.rows, tickfont: { size: look.font - 1 }, ticks: "", showgrid: false, zeroline: false, fixedrange: true });
        words(`<b>${panel.title}</b>`, { xref: "paper", yref: "paper", x: x[0], y: y[1], xshift: -2 });
        for (const [, begin, end] of this.spec.bands) {
          const place = { xref: "x" + number, yref: "y" + number + " domain", x0: begin, x1: end, y0: 0, y1: 1 };
          layout.shapes.push({ type: "rect", ...place, fillcolor: report.colour("limit"), opacity: 0.12, line: { width: 0 } });
        }
        for (const [name, bound] of panel.bounds) {
          const place = { xref: "x" + number + " domain", yref: "y" + number, x0: 0, x1: 1, y0: bound, y1: bound };
          layout.shapes.push({ type: "line", ...place, line: { color: report.colour("limit"), width: 1.2, dash: "dot" } });
          const at = this.spec.logarithmic ? Math.log10(bound) : bound, [low, high] = layout["yaxis" + number].range;
          const below = at > (low + high) / 2; // below the line if it is in the upper half, so that it does not hide the title
          if (at > low && at < high) words(name, { xref: "x" + number + " domain", yref: "y" + number, x: 1, y: at, xanchor: "right", yanchor: below ? "top" : "bottom", bgcolor: report.colour("page"), opacity: 0.85 }, look.font - 1.5, report.colour("limit"));
        }
      });
      return layout;
    }

    draw() {
      if (this.drawn && !this.stale) return;
      const begun = this.drawn, shape = this.geometry();
      Object.assign(this, { drawn: true, stale: false, range: report.range });
      this.frame.style.minHeight = shape.height + "px";
      const settings = { displaylogo: false, displayModeBar: false, responsive: true, plotlyServerURL: "", doubleClick: false };
      const layout = { ...this.layout(shape, this.range), autosize: !report.paper, ...(report.paper ? { width: report.paper } : {}) };
      Plotly.react(this.graph, this.traces(shape.look, this.range), layout, settings);
      if (!begun && this.spec.timed) {
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

    // Redraw after a change of the width, so that the gaps between the panels keep their size in pixels.
    resized(width) {
      if (report.paper || Math.abs(width - (this.width || width)) < 1) { this.width = width; return; }
      Object.assign(this, { width, stale: true });
      if (this.drawn && this.inSight) this.draw();
    }

    // Show another time range; the plot that was zoomed keeps its vertical axes.
    show(keep) {
      if (!this.drawn) return;
      if (!keep) { this.stale = true; if (this.inSight) this.draw(); return; }
      this.range = report.range;
      Plotly.react(this.graph, this.traces(this.geometry().look, this.range), this.graph.layout);
      this.moveCursor();
    }

    moveCursor() {
      if (!this.drawn || !this.spec.timed || !(this.inSight || report.paper)) return;
      const { width, inner, margin, domain } = this.geometry(), at = (report.time - this.range[0]) / (this.range[1] - this.range[0]);
      const drawn = (report.paper ? width : this.frame.clientWidth) - margin.l - margin.r;
      this.cursors.forEach((line, k) => {
        const [left, right] = domain(k).x, [bottom, top] = domain(k).y;
        line.style.display = at >= 0 && at <= 1 ? "" : "none";
        line.style.left = margin.l + drawn * (left + at * (right - left)) + "px";
        line.style.top = margin.t + inner.height * (1 - top) + "px";
        line.style.height = inner.height * (top - bottom) + "px";
      });
    }

    // Return the plot with its current zoom as SVG of this width [mm], in light colours for any theme of the page.
    async svg(mm) {
      const root = document.documentElement, theme = root.dataset.theme, shape = this.geometry(mm);
      root.dataset.theme = "light";
      const range = this.range || report.range, layout = { ...this.layout(shape, range), width: shape.width, paper_bgcolor: "#ffffff" };
      const traces = this.traces(shape.look, range);
      shape.legend.forEach((row, k) => row.forEach(([name, role, left]) => this.legendEntry(layout, shape, name, role, left, k)));
      root.dataset.theme = theme;
      const found = await Plotly.toImage({ data: traces, layout, config: { plotlyServerURL: "" } }, { format: "svg", width: shape.width, height: shape.height });
      const drawing = new DOMParser().parseFromString(decodeURIComponent(found.slice(found.indexOf(",") + 1)), "image/svg+xml").documentElement;
      drawing.setAttribute("viewBox", `0 0 ${shape.width} ${shape.height}`);
      drawing.setAttribute("width", mm + "mm");
      drawing.setAttribute("height", (shape.height / PIXELS_PER_MM).toFixed(2) + "mm");
      const about = document.createElementNS("http://www.w3.org/2000/svg", "desc");
      about.textContent = this.caption;
      drawing.prepend(about);
      return { text: new XMLSerializer().serializeToString(drawing), width: shape.width, height: shape.height };
    }

    legendEntry(layout, shape, name, role, left, row) {
      const { look, margin, inner } = shape, look_of = report.data.roles[role], width = Math.max(look_of.width, 1.5) * look.line;
      const above = margin.t - look.margin.t + 2 - row * look.legend - look.legend / 2, y = 1 + above / inner.height, x = left / inner.width;
      const line = { color: report.colour(role), width, dash: look_of.width ? dash(look_of, width) : "dot" };
      layout.shapes.push({ type: "line", xref: "paper", yref: "paper", x0: x, x1: x + 18 / inner.width, y0: y, y1: y, line, opacity: look_of.opacity });
      layout.annotations.push({ text: name, showarrow: false, xref: "paper", yref: "paper", x: x + 21 / inner.width, y, xanchor: "left", yanchor: "middle", font: { size: look.font, color: layout.font.color } });
    }

    get caption() { return `${this.spec.title} (${report.data.name}). ${this.spec.caption}`; }

    // Return a file for a paper: the plot as SVG or PNG of this width [mm], or its caption as text.
    async picture(format, mm) {
      if (format === "txt") return new Blob([this.caption + "\n"], { type: "text/plain" });
      const { text, width, height } = await this.svg(mm), drawing = new Blob([text], { type: "image/svg+xml" });
      return format === "svg" ? drawing : report.rasterise(drawing, width / PIXELS_PER_MM, height / PIXELS_PER_MM, DOTS_PER_INCH);
    }

    async save(format, mm) {
      const link = document.createElement("a");
      link.href = URL.createObjectURL(await this.picture(format, mm));
      link.download = [report.data.name.replace(/[^\w.-]+/g, "_"), this.spec.key, ...(format === "txt" ? ["caption"] : [mm + "mm"])].join("_") + "." + format;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    }
  }

  report.makePlots = () => {
    report.plots = report.data.plots.map((spec) => new PlotView(spec, document.getElementById("plot-" + spec.key)));
    const views = new Map(report.plots.map((view) => [view.frame, view]));
    const observer = new IntersectionObserver((entries) => entries.forEach((entry) => {
      const view = views.get(entry.target);
      view.inSight = entry.isIntersecting;
      if (view.inSight) { view.draw(); view.moveCursor(); }
    }), { rootMargin: "200px" });
    const resized = new ResizeObserver((entries) => entries.forEach((entry) => views.get(entry.target).resized(entry.contentRect.width)));
    report.plots.forEach((view) => { observer.observe(view.frame); resized.observe(view.frame); });
  };
  report.drawAll = () => report.plots.forEach((view) => { view.stale = true; view.draw(); });
}
