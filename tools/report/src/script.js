"use strict";
// Values under the pointer: a line at the nearest frame, and a box with what each series is there.
for (const figure of document.querySelectorAll("figure.plot")) {
  const source = figure.querySelector("script"), svg = figure.querySelector("svg[role=img]");
  if (!source || !svg) continue;
  const data = JSON.parse(source.textContent), [left, top, right, bottom] = data.box;
  const across = [...new Set(data.series.flatMap(s => s.points.map(p => p[0])))].sort((a, b) => a - b);
  const place = x => left + (right - left) * (data.log ? Math.log(x / data.from) / Math.log(data.to / data.from) : (x - data.from) / (data.to - data.from));
  const shown = across.filter(x => !data.log || x > 0), cursor = svg.querySelector(".cursor");
  const box = document.createElement("div");
  box.className = "tip";
  box.setAttribute("role", "status");
  figure.append(box);
  svg.tabIndex = 0;
  let at = -1;
  const show = index => {
    if (!shown.length) return;
    at = Math.max(0, Math.min(shown.length - 1, index));
    const x = shown[at], px = place(x);
    cursor.setAttribute("x1", px); cursor.setAttribute("x2", px);
    cursor.setAttribute("y1", top); cursor.setAttribute("y2", bottom);
    box.replaceChildren();
    const row = (name, value, ink) => {
      const line = document.createElement("div"), key = document.createElement("span"), text = document.createElement("b");
      if (ink) { key.textContent = "■ "; const known = svg.closest(".plot").querySelector(`.legend [stroke="${ink}"], .legend [fill="${ink}"]`); key.style.color = known ? getComputedStyle(known)[known.hasAttribute("stroke") ? "stroke" : "fill"] : ink; }
      text.textContent = value;
      line.append(key, name + " ", text);
      box.append(line);
    };
    row(data.across, String(+x.toPrecision(6)));
    for (const series of data.series) {
      const point = series.points.find(p => p[0] === x);
      if (point) row(series.name, point[1], series.ink);
    }
    const mark = data.marks.filter(m => m[0] <= x).pop();
    if (mark) row("schedule", mark[1]);
    figure.classList.add("pointed");
    const area = svg.getBoundingClientRect(), outer = figure.getBoundingClientRect(), scale = area.width / svg.viewBox.baseVal.width;
    const right_of = area.left - outer.left + px * scale + 10, fits = right_of + box.offsetWidth < outer.width;
    box.style.left = Math.max(0, fits ? right_of : right_of - 20 - box.offsetWidth) + "px";
    box.style.top = area.top - outer.top + top * scale + "px";
  };
  const hide = () => { figure.classList.remove("pointed"); at = -1; };
  const follow = event => {
    const area = svg.getBoundingClientRect(), px = (event.clientX - area.left) * svg.viewBox.baseVal.width / area.width;
    let best = 0;
    shown.forEach((x, k) => { if (Math.abs(place(x) - px) < Math.abs(place(shown[best]) - px)) best = k; });
    show(best);
  };
  svg.addEventListener("pointermove", follow);
  svg.addEventListener("pointerdown", follow);
  svg.addEventListener("pointerleave", event => { if (event.pointerType === "mouse") hide(); });
  svg.addEventListener("blur", hide);
  svg.addEventListener("keydown", event => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (step) { event.preventDefault(); show(at < 0 ? 0 : at + step); } else if (event.key === "Escape") hide();
  });
}
// Points: the words of the one that is pointed at, or that has the focus.
for (const svg of document.querySelectorAll("svg.scatter")) {
  const figure = svg.closest("figure"), box = document.createElement("div");
  box.className = "tip words";
  box.setAttribute("role", "status");
  figure.append(box);
  const hide = () => figure.classList.remove("pointed");
  const show = event => {
    const words = event.target.dataset && event.target.dataset.words;
    if (!words) return hide();
    box.textContent = words;
    figure.classList.add("pointed");
    const at = event.target.getBoundingClientRect(), outer = figure.getBoundingClientRect();
    box.style.left = Math.max(0, Math.min(at.left - outer.left, outer.width - box.offsetWidth)) + "px";
    box.style.top = at.bottom - outer.top + 6 + "px";
  };
  for (const name of ["pointerover", "pointerdown", "focusin"]) svg.addEventListener(name, show);
  for (const name of ["pointerleave", "focusout"]) svg.addEventListener(name, hide);
}
// Tables: a click on a head sorts by its column, a second one the other way; a button saves CSV.
const number = text => {
  const found = text.replace(/,/g, "").match(/^[-+]?\d*\.?\d+(e[-+]?\d+)?/i);
  if (!found) return NaN;
  const unit = { KiB: 1024, MiB: 2 ** 20, GiB: 2 ** 30, TiB: 2 ** 40 }[text.split(" ")[1]];
  return +found[0] * (unit || 1);
};
// The heads above each column, from the top; heads that span rows or columns count for all of them.
const heads = table => {
  const grid = [];
  [...table.tHead.rows].forEach((row, r) => {
    let column = 0;
    for (const cell of row.cells) {
      while (grid[r] && grid[r][column]) column++;
      for (let y = r; y < r + cell.rowSpan; y++) for (let x = column; x < column + cell.colSpan; x++) (grid[y] = grid[y] || [])[x] = cell;
      column += cell.colSpan;
    }
  });
  return grid;
};
for (const table of document.querySelectorAll(".wide > table")) {
  const spans = [...table.tBodies].some(body => body.querySelector("[rowspan]"));
  if (table.tHead && table.tBodies.length === 1 && !spans && table.tBodies[0].rows.length > 1) {
    const grid = heads(table), last = grid[grid.length - 1], body = table.tBodies[0];
    last.forEach((head, column) => {
      if (head.colSpan > 1) return;
      head.classList.add("sorts");
      head.tabIndex = 0;
      const sort = () => {
        const down = head.getAttribute("aria-sort") === "ascending", cells = row => row.cells[column].textContent.trim();
        const rows = [...body.rows].map((row, k) => ({ row, k, text: cells(row), value: number(cells(row)) }));
        rows.sort((a, b) => {
          const known = Number.isNaN(a.value) - Number.isNaN(b.value);
          const order = Number.isNaN(a.value) && Number.isNaN(b.value) ? a.text.localeCompare(b.text) : a.value - b.value;
          return known || (down ? -order : order) || a.k - b.k;
        });
        last.forEach(other => other.removeAttribute("aria-sort"));
        head.setAttribute("aria-sort", down ? "descending" : "ascending");
        body.append(...rows.map(row => row.row));
      };
      head.addEventListener("click", sort);
      head.addEventListener("keydown", event => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); sort(); } });
    });
  }
  const save = document.createElement("button");
  save.type = "button";
  save.className = "csv";
  save.textContent = "Save as CSV";
  save.addEventListener("click", () => {
    const plain = text => /^-?\d{1,3}(,\d{3})+(\.\d+)?$/.test(text) ? text.replace(/,/g, "") : text;
    const quoted = text => /[",\n]/.test(text) ? '"' + text.replace(/"/g, '""') + '"' : text;
    const rows = [], fill = (section, at) => [...section.rows].forEach((row, r) => {
      let column = 0;
      for (const cell of row.cells) {
        while (rows[at + r] && rows[at + r][column] !== undefined) column++;
        for (let y = r; y < r + cell.rowSpan; y++) for (let x = 0; x < cell.colSpan; x++) (rows[at + y] = rows[at + y] || [])[column + x] = plain(cell.textContent.trim());
        column += cell.colSpan;
      }
    });
    for (const section of [table.tHead, ...table.tBodies]) if (section) fill(section, rows.length);
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([rows.map(row => [...row].map(text => quoted(text || "")).join(",")).join("\n") + "\n"], { type: "text/csv" }));
    link.download = (document.title + " table").replace(/[^\w.-]+/g, "-") + ".csv";
    link.click();
    URL.revokeObjectURL(link.href);
  });
  table.parentElement.after(save);
}
