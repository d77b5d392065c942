"use strict";
// One panel of a chart as uPlot draws it: lines, points or bars; over time, any axis or rows.
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
// black lines are drawn in the colour of text, limits in that of failures: seen on dark paper too
const colour = (value) => (value === "#000000" ? css("--ink") : value === "#AA0000" ? css("--bad") : value);
const faded = (value, opacity) => {
  const whole = colour(value); // #222 is #222222
  return (whole.length === 4 ? `#${[...whole.slice(1)].map((digit) => digit + digit).join("")}` : whole) + opacity;
};
const NONE = "\u2013";
const ROW = 24; // pixels
const FONT = "12px system-ui, sans-serif";

const plain = (value, digits) => (value === null || value === undefined ? NONE : String(Number(value.toPrecision(digits))));

// decades; 2 and 5 of each where there are few; every digit within one
const logTicks = (plot, ticks, number) => {
  const { min, max } = plot.scales[plot.axes[number].scale];
  const digits = max / min < 8 ? /^[1-9]\.0000e/ : max / min < 300 ? /^[125]\.0000e/ : /^1\.0000e/;
  return ticks.map((tick) => (tick !== null && digits.test(tick.toExponential(4)) ? tick : null));
};

const axis = (log, extra) => ({
  stroke: () => css("--ink"),
  grid: { stroke: () => css("--line"), width: 1, ...(log ? { filter: logTicks } : {}) },
  ticks: { stroke: () => css("--line"), width: 1, ...(log ? { filter: logTicks } : {}) },
  font: FONT,
  labelFont: FONT,
  labelSize: 18,
  ...(log ? { filter: logTicks, values: (_, ticks) => ticks.map((tick) => (tick === null ? "" : plain(tick, 6))) } : {}),
  ...extra,
});

const series = (each) => {
  const dots = each.points || each.size > 0;
  return {
    label: each.name,
    stroke: () => colour(each.color),
    fill: each.fill || each.bars ? () => faded(each.color, each.bars ? "cc" : "88") : undefined,
    dash: each.dash || [],
    width: each.points ? 0 : each.width || 1.5,
    paths: each.points ? () => null : each.bars ? uPlot.paths.bars({ size: [0.7, ROW] }) : each.stepped ? uPlot.paths.stepped({ align: 1 }) : undefined,
    points: dots ? { show: true, size: each.size || 8, width: 1.5, stroke: () => colour(each.color), fill: () => (each.hollow ? "transparent" : faded(each.color, each.size ? "99" : "ff")) } : { show: false },
    value: (_, value) => plain(value, 4),
    spanGaps: Boolean(each.joined),
    auto: !each.aside, // a limit far away would flatten the lines
  };
};

// where a point is, in pixels of the canvas
const placeOf = (plot, row, i) => {
  const along = plot.valToPos(plot.data[0][i], "x", true);
  const value = plot.valToPos(plot.data[row][i], "y", true);
  return plot.scales.x.ori ? [value, along] : [along, value];
};

// names beside points, none over another or over a point: where no side is free, the cursor tells
const name = (plot, texts) => {
  const { ctx, bbox } = plot, unit = devicePixelRatio;
  const points = [];
  for (let row = 1; row < plot.data.length; row += 1) {
    if (plot.series[row].show) plot.data[row].forEach((value, i) => { if (value !== null) points.push([...placeOf(plot, row, i), i]); });
  }
  const done = new Set(); // a point may be of several series
  const mark = 5 * unit, taken = points.map(([x, y]) => [x - mark, y - mark, x + mark, y + mark]);
  ctx.save();
  ctx.font = FONT.replace("12", 12 * unit);
  ctx.textBaseline = "middle";
  ctx.textAlign = "left";
  ctx.lineWidth = 3 * unit;
  for (const [x, y, i] of points) {
    if (!texts[i] || done.has(i)) continue;
    const width = ctx.measureText(texts[i]).width, half = 7 * unit, away = 8 * unit, slant = 1.7 * half;
    const left = -away - width;
    const sides = [[away, 0], [left, 0]]; // of a bar; beside a point a line may go on
    const slants = [[away, -slant], [left, slant], [left, -slant], [away, slant]];
    for (const [dx, dy] of plot.scales.x.ori ? [...sides, ...slants] : [...slants, ...sides]) {
      const box = [x + dx, y + dy - half, x + dx + width, y + dy + half];
      const inside = box[0] >= bbox.left && box[1] >= bbox.top && box[2] <= bbox.left + bbox.width && box[3] <= bbox.top + bbox.height;
      if (!inside || taken.some((other) => box[0] < other[2] && other[0] < box[2] && box[1] < other[3] && other[1] < box[3])) continue;
      taken.push(box);
      done.add(i);
      ctx.strokeStyle = css("--paper");
      ctx.strokeText(texts[i], box[0], y + dy);
      ctx.fillStyle = css("--ink");
      ctx.fillText(texts[i], box[0], y + dy);
      break;
    }
  }
  ctx.restore();
};

// the point nearest to the cursor in both directions, not along the axis only
const nearest = () => {
  let found = null;
  return (plot, row, closest) => {
    if (row > 0) return found;
    const unit = devicePixelRatio, left = plot.cursor.left * unit + plot.bbox.left, top = plot.cursor.top * unit + plot.bbox.top;
    let least = Infinity;
    found = closest;
    for (let each = 1; each < plot.data.length; each += 1) {
      if (!plot.series[each].show) continue;
      plot.data[each].forEach((value, i) => {
        if (value === null) return;
        const [x, y] = placeOf(plot, each, i);
        const distance = (x - left) ** 2 + (y - top) ** 2;
        if (distance < least) { least = distance; found = i; }
      });
    }
    return found;
  };
};

const widest = (texts) => {
  const ruler = document.createElement("canvas").getContext("2d");
  ruler.font = FONT;
  return Math.max(...texts.map((text) => ruler.measureText(text).width));
};

const heightOf = (chart, panel) => (chart.rows ? ROW * chart.rows.length + 40 : panel.height || 170);

// room for the names of rows: as the longest needs, but no more than a third of the width
const rowAxis = (chart, width) => {
  const most = Math.max(width / 3, 70);
  const fit = (text) => {
    if (widest([text]) <= most) return text;
    let end = text.length;
    while (end > 1 && widest([`${text.slice(0, end)}\u2026`]) > most) end -= 1;
    return `${text.slice(0, end)}\u2026`;
  };
  const texts = chart.rows.map(fit);
  return axis(false, {
    side: 3,
    size: widest(texts) + 16,
    gap: 6,
    splits: () => chart.rows.map((_, i) => i),
    values: () => texts,
  });
};

const optionsOf = (chart, panel, x, whole, number, width, zoomed) => {
  const rows = Boolean(chart.rows), dots = panel.labels.length > 0;
  const ends = [x[0], x[x.length - 1]];
  const edge = dots ? 0.04 * (whole[1] - whole[0]) : 0; // no dot is cut
  const room = chart.x_log ? [whole[0] / 1.25, whole[1] * 1.25] : [whole[0] - edge, whole[1] + edge];
  const xRange = rows ? () => [-0.6, chart.rows.length - 0.4] : (_, low, high) => (low === ends[0] && high === ends[1] ? room : [low, high]);
  const above = rows && panel.texts.length ? 1.1 + (1.2 * widest(panel.texts)) / width : 1.08; // room for texts
  const yRange = panel.span.length ? panel.span : panel.zero ? (_, low, high) => [Math.min(low, 0), high > 0 ? above * high : 1] : panel.log ? (_, low, high) => [low / 1.3, high * 1.3] : undefined;
  const at = panel.labels.length ? (i) => panel.labels[i] : (i) => `${chart.x_name || ""} ${plain(x[i], 5)}`.trim();
  return {
    width,
    height: heightOf(chart, panel),
    cursor: {
      sync: rows || dots ? undefined : { key: `chart${number}` },
      drag: rows ? { x: false, y: true, setScale: true } : { x: true, y: false },
      dataIdx: dots ? nearest() : undefined,
    },
    legend: { live: true },
    scales: {
      x: { time: false, distr: chart.x_log ? 3 : 1, range: xRange, ...(rows ? { ori: 1, dir: -1 } : {}) },
      y: { distr: panel.log ? 3 : 1, range: yRange, ...(rows ? { ori: 0, dir: 1 } : {}) },
    },
    axes: rows
      ? [rowAxis(chart, width), axis(panel.log, { side: 2, size: 30, space: 70 })]
      : [axis(chart.x_log, { label: panel.last ? chart.x_label : undefined, size: 30 }), axis(panel.log, { size: 64 })],
    series: [{ label: dots ? "point" : "at", value: (_, v, s, i) => (i === null || v === null ? (dots ? "Point at a mark for its figures." : NONE) : at(i)) }, ...panel.series.map(series)],
    hooks: {
      setScale: [(plot, key) => { if (key === "x" && plot.status === 1) zoomed(plot); }],
      draw: panel.texts.length ? [(plot) => name(plot, panel.texts)] : [],
    },
  };
};
