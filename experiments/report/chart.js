// The chart of speed against accuracy; it uses the functions of the report's page.

// Okabe and Ito's colours on a dark ground, told apart also by those who do not see red or green.
const COLOURS = ["#56b4e9", "#e69f00", "#2fbf8f", "#e99ac4", "#f0e442", "#ff7f50", "#cccccc"];
const SHAPES = ["circle", "rect", "triangle", "rectRot", "crossRot", "star", "cross"];

function buildChart({ rows, x }) {
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

addEventListener("DOMContentLoaded", () => buildChart(CHART));
