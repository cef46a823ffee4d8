// Tables that sort, and the chart of speed against accuracy.

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

// Okabe and Ito's colours on a dark ground, told apart also by those who do not see red or green.
const COLOURS = ["#56b4e9", "#e69f00", "#2fbf8f", "#e99ac4", "#f0e442", "#ff7f50", "#cccccc"];
const SHAPES = ["circle", "rect", "triangle", "rectRot", "crossRot", "star", "cross"];

function buildChart() {
  if (!CONTENT.chart) return;
  const { title, rows, x } = CONTENT.chart;
  $("chart").hidden = false;
  $("chart-title").textContent = title;
  const keys = Object.keys(CONTENT.labels).filter(
    (key) => key !== x && rows.some((row) => typeof row[key] === "number"),
  );
  $("chart-metric").append(...keys.map((key) => element("option", { value: key }, arrowed(key))));
  Chart.defaults.color = "#d8d8d8";
  Chart.defaults.borderColor = "#3a3d42";
  const chart = new Chart($("chart-canvas"), {
    type: "scatter",
    data: { datasets: [] },
    options: {
      maintainAspectRatio: false,
      animation: false,
      scales: {
        x: { type: "logarithmic", title: { display: true, text: CONTENT.labels[x] } },
        y: { title: { display: true, text: "" } },
      },
      plugins: {
        legend: { labels: { usePointStyle: true } },
        tooltip: {
          callbacks: {
            label: ({ raw }) =>
              raw.name && `${raw.name}: ${number(raw.y)} in ${number(raw.x)} ${CONTENT.labels[x]}`,
          },
        },
      },
    },
  });
  const show = () => {
    const key = $("chart-metric").value;
    chart.data.datasets = datasets(
      rows.filter((row) => typeof row[key] === "number"),
      x,
      key,
    );
    chart.options.scales.y.title.text = arrowed(key);
    chart.update();
  };
  $("chart-metric").addEventListener("change", show);
  show();
}

function datasets(rows, x, key) {
  const points = (some) => some.map((row) => ({ x: row[x], y: row[key], name: row.method }));
  const families = [...new Set(rows.map((row) => row.family))];
  const sets = families.map((family, i) => ({
    label: family,
    data: points(rows.filter((row) => row.family === family)),
    backgroundColor: COLOURS[i % 7],
    borderColor: COLOURS[i % 7],
    pointStyle: SHAPES[i % 7],
    radius: 7,
    hoverRadius: 10,
    borderWidth: 2,
  }));
  return [
    ...sets,
    {
      label: "front: none is better and faster",
      data: points(front(rows, x, key)),
      showLine: true,
      radius: 0,
      hitRadius: 0,
      borderColor: "#fff8",
      borderWidth: 1,
    },
  ];
}

/** The rows that no faster one equals, the fastest first. */
function front(rows, x, key) {
  const sign = CONTENT.lower.includes(key) ? -1 : 1;
  const best = [];
  for (const row of sorted(rows, x, true))
    if (!best.length || sign * row[key] > sign * best.at(-1)[key]) best.push(row);
  return best;
}
