"use strict";
// Of all scripts of a page, which follow in the same element.
const make = (tag, text, className) => {
  const node = document.createElement(tag);
  if (text) node.textContent = text;
  if (className) node.className = className;
  if (tag === "button") node.type = "button";
  return node;
};
// Switch of light and dark, sorting and CSV of the tables: all by keyboard too.
{
  const root = document.documentElement;
  const theme = make("button", "", "theme");
  const dark = () => (root.dataset.theme || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light")) === "dark";
  const label = () => { theme.textContent = dark() ? "Light" : "Dark"; theme.title = `Show in ${dark() ? "light" : "dark"} colours`; };
  theme.addEventListener("click", () => {
    root.dataset.theme = dark() ? "light" : "dark";
    label();
    document.dispatchEvent(new Event("theme"));
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { label(); document.dispatchEvent(new Event("theme")); });
  label();
  document.querySelector("header").prepend(theme);

  // the first number of a cell: "1,234", "0.53..0.61", "0.12*"; NaN where it begins with a word
  const number = (text) => {
    const found = /^[+\u2264\u2265 ]*(-?\d[\d,]*\.?\d*(?:e[+-]?\d+)?|-?\.\d+)/i.exec(text);
    return found ? Number(found[1].replaceAll(",", "")) : NaN;
  };
  const text = (cell) => cell.innerText.trim().replace(/\s*\n\s*/g, " ");

  const sort = (table, column, heading) => {
    const up = heading.getAttribute("aria-sort") !== "ascending";
    const body = table.tBodies[0];
    const rows = [...body.rows].map((row) => ({ row, text: text(row.cells[column]) }));
    const isText = heading.classList.contains("name");
    rows.forEach((each) => { each.number = number(each.text); });
    rows.sort((a, b) => {
      if (isText) return (up ? 1 : -1) * a.text.localeCompare(b.text, "en", { numeric: true });
      if (Number.isNaN(a.number) || Number.isNaN(b.number)) return Number.isNaN(a.number) - Number.isNaN(b.number);
      return (up ? 1 : -1) * (a.number - b.number);
    });
    body.append(...rows.map((each) => each.row));
    for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
    heading.setAttribute("aria-sort", up ? "ascending" : "descending");
    table.classList.add("sorted");
  };

  // as qpmpc/report/csv_text.py: a spreadsheet computes what begins so, but for a figure, which may
  // be followed by its unit, a range or words; they hold nothing that computes
  const formula = /^\s*[=+\-@\uFF1D\uFF0B\uFF0D\uFF20]/;
  const figures = /^[+-]?[\d.][\d,]*(?:[\w\s.,%[\]\u00B0]|-(?=[\d.]))*\*?$|^-$/;
  const inert = (cell) => (formula.test(cell) && !figures.test(cell) ? `'${cell}` : cell);
  const quoted = (cell) => /[",;\t\n]/.test(cell) ? `"${cell.replaceAll('"', '""')}"` : cell;
  const download = (table) => {
    const lines = [...table.rows].map((row) => [...row.cells].map((cell) => quoted(inert(text(cell)))).join(","));
    const link = make("a");
    link.href = URL.createObjectURL(new Blob([lines.join("\n") + "\n"], { type: "text/csv" }));
    link.download = `${table.dataset.file || "table"}.csv`;
    link.click();
    URL.revokeObjectURL(link.href);
  };

  for (const table of document.querySelectorAll("table.data")) {
    [...table.tHead.rows[0].cells].forEach((heading, column) => {
      const button = make("button", heading.textContent);
      heading.replaceChildren(button);
      button.addEventListener("click", () => sort(table, column, heading));
    });
    const tools = make("div", "", "tools");
    const csv = make("button", "Download CSV");
    csv.addEventListener("click", () => download(table));
    tools.append(csv);
    table.parentElement.before(tools);
  }
}
