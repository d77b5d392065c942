"use strict";
// Charts of panels over one common axis: zoom and cursor are linked, groups can be left out.
{
  const show = (figure, chart, number) => {
    const plots = make("div", "", "plots");
    const tools = make("div", "", "tools");
    const hidden = new Set();
    const common = chart.x || Array.from({ length: chart.count }, (_, i) => i);
    const whole = [Math.min(...common), Math.max(...common)];
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
    const [scaled, back] = chart.x_log ? [Math.log, Math.exp] : [Number, Number];
    const about = (factor, shift) => {
      const [first, last] = whole.map(scaled);
      let [low, high] = range[0] === null ? [first, last] : range.map(scaled);
      const middle = (low + high) / 2 + shift * (high - low);
      const half = Math.min((high - low) * factor, last - first) / 2;
      low = Math.max(middle - half, first);
      high = Math.min(low + 2 * half, last);
      zoom(back(high - 2 * half), back(high));
    };

    const build = (panel) => {
      const box = make("div", "", panel.labels.length ? "panel dots" : "panel");
      box.append(make("h3", panel.label));
      plots.append(box);
      const x = panel.x.length ? panel.x : common;
      const zoomed = chart.rows ? () => {} : (plot) => zoom(plot.scales.x.min, plot.scales.x.max);
      const options = optionsOf(chart, panel, x, whole, number, Math.max(plots.clientWidth, 200), zoomed);
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
    const zooms = [["Zoom in", () => about(0.5, 0)], ["Zoom out", () => about(2, 0)]];
    const steps = [["Earlier", () => about(1, -0.5)], ["Later", () => about(1, 0.5)]];
    for (const [name, act] of [...(chart.rows ? [] : zooms), ...(chart.count ? steps : []), ["All", reset]]) {
      const button = make("button", name);
      button.addEventListener("click", act);
      tools.append(button);
    }
    tools.append(make("span", "Drag to zoom, double click for all.", "quiet"));

    figure.insertBefore(tools, figure.querySelector("img"));
    figure.insertBefore(plots, figure.querySelector("img"));
    chart.panels.forEach((panel, i) => build({ ...panel, last: i === chart.panels.length - 1 }));
    figure.classList.add("live");
    new ResizeObserver(() => {
      const width = plots.clientWidth;
      if (width) for (const { plot, panel } of panels) if (plot.width !== width) plot.setSize({ width, height: heightOf(chart, panel) });
    }).observe(plots);
    document.addEventListener("theme", () => panels.forEach(({ plot }) => plot.redraw(false, true)));
    return { panels, zoom };
  };

  let number = 0;
  for (const figure of document.querySelectorAll("figure.chart")) {
    figure.charts = [...figure.querySelectorAll("script")].map((script) => {
      number += 1;
      return show(figure, JSON.parse(script.textContent), number);
    });
    [figure.chart] = figure.charts;
  }
}
