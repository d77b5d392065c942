"use strict";
// Charts of panels over one common axis: zoom and cursor are linked, groups can be left out.
{
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  // black lines are drawn in the colour of text: on dark paper too they are seen
  const colour = (value) => (value === "#000000" ? css("--ink") : value);

  const show = (figure, chart, number) => {
    const plots = make("div", "", "plots");
    const tools = make("div", "", "tools");
    const hidden = new Set();
    const x = chart.x || Array.from({ length: chart.count }, (_, i) => i);
    const whole = [Math.min(...x), Math.max(...x)];
    const panels = [];
    let range = [null, null];
    let busy = false;

    const zoom = (low, high) => {
      if (busy) return;
      busy = true; // setting the others would come back here
      range = [low, high];
      for (const panel of panels) panel.plot.setScale("x", { min: low, max: high });
      busy = false;
    };
    const reset = () => {
      busy = true;
      range = [null, null];
      for (const panel of panels) panel.plot.setData(panel.plot.data, true);
      busy = false;
    };
    const about = (factor, shift) => {
      let [low, high] = range[0] === null ? whole : range;
      const middle = (low + high) / 2 + shift * (high - low);
      const half = Math.min((high - low) * factor, whole[1] - whole[0]) / 2;
      low = Math.max(middle - half, whole[0]);
      high = Math.min(low + 2 * half, whole[1]);
      zoom(high - 2 * half, high);
    };

    const axis = (extra) => ({ stroke: () => css("--ink"), grid: { stroke: () => css("--line"), width: 1 }, ticks: { stroke: () => css("--line"), width: 1 }, font: "12px system-ui, sans-serif", ...extra });
    const series = (each) => {
      const points = Boolean(chart.points);
      return {
        label: each.name,
        stroke: () => colour(each.color),
        fill: each.fill ? () => each.color + "88" : undefined,
        dash: each.dash || [],
        width: points ? 0 : each.width || 1.5,
        paths: points ? () => null : each.stepped ? uPlot.paths.stepped({ align: 1 }) : undefined,
        points: points ? { show: true, size: 8, fill: () => colour(each.color) } : { show: false },
        value: (_, value) => (value === null || value === undefined ? "\u2013" : String(Number(value.toPrecision(4)))),
        spanGaps: false,
      };
    };
    const build = (panel) => {
      const box = make("div", "", "panel");
      box.append(make("h3", panel.label));
      plots.append(box);
      const labelled = (value) => (chart.labels ? (_, v, s, i) => (i === null || v === null ? "\u2013" : chart.labels[i]) : (_, v) => (v === null ? "\u2013" : `${value} ${Number(v.toPrecision(5))}`));
      const options = {
        width: Math.max(plots.clientWidth, 200),
        height: panel.height || 170,
        cursor: { sync: { key: `chart${number}` }, drag: { x: true, y: false } },
        legend: { live: true },
        scales: { x: { time: false, distr: chart.x_log ? 3 : 1 }, y: { distr: panel.log ? 3 : 1, range: panel.span && panel.span.length ? panel.span : panel.zero ? (_, low, high) => [Math.min(low, 0), high > 0 ? 1.08 * high : 1] : undefined } },
        axes: [axis({ label: panel.last ? chart.x_label : undefined, labelSize: 18, size: 30, values: chart.x_log ? (u, ticks) => ticks.map((t) => (t === null ? "" : String(Number(t.toPrecision(6))))) : undefined }), axis({ size: 56 })],
        series: [{ label: chart.labels ? "point" : "at", value: labelled(chart.x_name || "") }, ...panel.series.map(series)],
        hooks: { setScale: [(plot, key) => { if (key === "x" && plot.status === 1) zoom(plot.scales.x.min, plot.scales.x.max); }] },
      };
      const plot = new uPlot(options, [x, ...panel.series.map((each) => each.values)], box);
      plot.over.addEventListener("dblclick", reset);
      panels.push({ box, plot, panel });
    };

    const apply = () => {
      for (const { box, plot, panel } of panels) {
        const groups = panel.series.map((each) => each.group).filter(Boolean);
        box.hidden = groups.length > 0 && groups.length === panel.series.filter((s) => !s.aside).length && groups.every((group) => hidden.has(group));
        panel.series.forEach((each, i) => {
          const seen = !hidden.has(each.group);
          if (each.group && plot.series[i + 1].show !== seen) plot.setSeries(i + 1, { show: seen });
        });
      }
    };
    for (const group of chart.groups || []) {
      const label = make("label");
      const box = make("input");
      box.type = "checkbox";
      box.checked = true;
      box.addEventListener("change", () => { hidden[box.checked ? "delete" : "add"](group.name); apply(); });
      const swatch = make("span", "", "swatch");
      swatch.style.borderTopColor = group.color === "#000000" ? "var(--ink)" : group.color;
      if (group.dash && group.dash.length) swatch.style.borderTopStyle = "dashed";
      label.append(box, swatch, make("span", group.name));
      tools.append(label);
    }
    for (const [name, act] of [["Zoom in", () => about(0.5, 0)], ["Zoom out", () => about(2, 0)], ["Earlier", () => about(1, -0.5)], ["Later", () => about(1, 0.5)], ["All", reset]]) {
      if (chart.points && (name === "Earlier" || name === "Later")) continue;
      const button = make("button", name);
      button.addEventListener("click", act);
      tools.append(button);
    }
    tools.append(make("span", "Drag to zoom, double click for all.", "quiet"));

    figure.prepend(tools, plots);
    chart.panels.forEach((panel, i) => build({ ...panel, last: i === chart.panels.length - 1 }));
    figure.classList.add("live");
    new ResizeObserver(() => {
      const width = plots.clientWidth;
      if (width) for (const { plot, panel } of panels) if (plot.width !== width) plot.setSize({ width, height: panel.height || 170 });
    }).observe(plots);
    document.addEventListener("theme", () => panels.forEach(({ plot }) => plot.redraw(false, true)));
    figure.chart = { panels, zoom };
  };

  document.querySelectorAll("figure.chart").forEach((figure, number) => {
    show(figure, JSON.parse(figure.querySelector("script").textContent), number);
  });
}
