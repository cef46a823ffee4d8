// Tables that sort.

/** A table of `rows`, sorted by a click on a heading; `columns` maps keys to headings. */
function sortable(columns, rows, name = (row, text) => text) {
  const keys = Object.keys(columns),
    body = element("tbody"),
    head = element("tr");
  const best = Object.fromEntries(keys.slice(1).map((key) => [key, bestOf(rows, key)]));
  const fill = (sorted) =>
    body.replaceChildren(
      ...sorted.map((row) =>
        element(
          "tr",
          {},
          ...keys.map((key, i) => {
            const text = number(row[key]);
            return element(
              "td",
              { className: i && row[key] === best[key] ? "best" : "" },
              i ? text : name(row, text),
            );
          }),
        ),
      ),
    );
  for (const key of keys) {
    const heading = element(
      "th",
      { scope: "col" },
      element("button", { type: "button" }, columns[key]),
    );
    heading.firstChild.onclick = () => {
      const up = heading.getAttribute("aria-sort") === "descending";
      for (const other of head.children) other.removeAttribute("aria-sort");
      heading.setAttribute("aria-sort", up ? "ascending" : "descending");
      fill(sorted(rows, key, up));
    };
    head.append(heading);
  }
  fill(rows);
  const scroll = { className: "scroll", tabIndex: 0, role: "region", ariaLabel: "Table" };
  return element("div", scroll, element("table", {}, element("thead", {}, head), body));
}

/** Rows by one column; what has no number there comes last either way. */
function sorted(rows, key, up) {
  const missing = (value) => value == null || Number.isNaN(value);
  const order = (a, b) => (a > b) - (a < b);
  return [...rows].sort((a, b) => {
    const [p, q] = [a[key], b[key]];
    if (missing(p) || missing(q)) return missing(p) - missing(q);
    return up ? order(p, q) : order(q, p);
  });
}

function bestOf(rows, key) {
  if (!(key in CONTENT.labels)) return undefined;
  const values = rows
    .map((row) => row[key])
    .filter((v) => typeof v === "number" && !Number.isNaN(v));
  if (values.length < 2) return undefined;
  return CONTENT.lower.includes(key) ? Math.min(...values) : Math.max(...values);
}

function arrowed(key) {
  return `${CONTENT.labels[key]} ${CONTENT.lower.includes(key) ? "↓" : "↑"}`;
}

/** The metrics of the scene's images. */
function buildMetrics() {
  const measured = state.scene.images.filter((image) => image.metrics);
  $("metrics").hidden = !measured.length;
  $("metrics").querySelector(".scroll")?.remove();
  if (!measured.length) return;
  const keys = Object.keys(measured[0].metrics);
  const columns = { name: "image", ...Object.fromEntries(keys.map((key) => [key, arrowed(key)])) };
  const rows = measured.map((image) => ({ name: image.name, image, ...image.metrics }));
  const link = (row, text) =>
    element("button", { type: "button", onclick: () => choose("left", row.image) }, text);
  $("metrics").append(sortable(columns, rows, link));
}

/** Tables that came with the page; short ones are open. */
function buildTables() {
  $("tables").append(
    ...CONTENT.tables.map(({ title, note, columns, rows }) =>
      element(
        "details",
        { open: rows.length <= 25 },
        element("summary", {}, title),
        element("p", { className: "hint" }, note),
        sortable(columns, rows),
      ),
    ),
  );
}
