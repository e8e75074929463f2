// The report of `cnerf compare`: draws tables, pictures and plots of the JSON in #data.
// data.table is what table.json holds; data.methods and data.captures add the summaries and the pictures.
'use strict';

const data = JSON.parse(document.getElementById('data').textContent);
const { columns, cells } = data.table;
const bounds = ['grey', 'oracle'];  // do not compete
const colors = ['#d62728', '#ff7f0e', '#2ca02c', '#1f77b4', '#9467bd', '#8c564b', '#7f7f7f', '#17becf', '#bcbd22', '#e377c2'];
const colorOf = (method) => colors[Math.max(0, data.methods.findIndex((each) => each.name === method)) % colors.length];

// An element: attributes, then children, which are elements or text.
function fill(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children.flat(Infinity).filter((child) => child !== null));
  return element;
}
const make = (name, attributes = {}, ...children) => fill(document.createElement(name), attributes, children);
const draw = (name, attributes = {}, ...children) =>
  fill(document.createElementNS('http://www.w3.org/2000/svg', name), attributes, children);
const row = (kind, values) => make('tr', {}, values.map((value) => make(kind, {}, value)));
const put = (id, ...children) => document.getElementById(id).prepend(...children.flat(Infinity));

const short = (value) => String(Number(value.toPrecision(4)));
const signed = (value, digits) => (value < 0 ? '' : '+') + value.toFixed(digits);
const estimate = (value, digits) =>
  value ? value.mean.toFixed(digits) + (value.ci95 === undefined ? '' : ` ± ${value.ci95.toFixed(digits)}`) : '';

// Rows of methods; the best mean of each column is bold.
function methodTable(rows) {
  const best = columns.map(({ name, better }) =>
    Math.max(...rows.filter((each) => better && each[name] && !bounds.includes(each.method))
      .map((each) => better * each[name].mean)));
  const cell = (each, { name, better, digits }, c) =>
    make('td', each[name] && better && better * each[name].mean === best[c] ? { class: 'best' } : {},
      estimate(each[name], digits));
  const head = columns.map(({ title, better, help }) =>
    make('th', { title: help }, title + (better > 0 ? ' ↑' : better < 0 ? ' ↓' : '')));
  return make('div', { class: 'wide' }, make('table', {}, make('tr', {}, make('th', {}, 'Method'), head),
    rows.map((each) => [
      make('tr', {}, make('td', {}, each.method), columns.map((column, c) => cell(each, column, c))),
      each.error ? make('tr', {}, make('td', { class: 'failed', colspan: columns.length + 1 },
        `${each.method} failed: ${each.error}`)) : null,
    ])));
}

// Points {method, label, x, y, spread} over positions 0 ... positions - 1.
function plot(title, points, positions) {
  if (points.length === 0) return null;
  const width = 360, height = 200, left = 46, top = 26, right = 10, bottom = 18;
  const least = Math.min(...points.map((p) => p.y - p.spread)), most = Math.max(...points.map((p) => p.y + p.spread));
  const margin = Math.max(0.05 * (most - least), 1e-6);
  const low = least - margin, high = most + margin;
  const placeX = (x) => left + (x + 0.5) / positions * (width - left - right);
  const placeY = (y) => top + (high - y) / (high - low) * (height - top - bottom);
  return draw('svg', { width, height, viewBox: `0 0 ${width} ${height}` }, draw('text', { x: 8, y: 16 }, title),
    [least, most].map((y) => draw('text', { x: 4, y: placeY(y) + 4 }, short(y))),
    points.map(({ method, label, x, y, spread }) => [
      spread > 0 ? draw('line', { x1: placeX(x), x2: placeX(x), y1: placeY(y - spread), y2: placeY(y + spread),
        stroke: colorOf(method) }) : null,
      draw('circle', { cx: placeX(x), cy: placeY(y), r: 3.5, fill: colorOf(method) },
        draw('title', {}, `${method}, ${label}: ${short(y)}`)),
    ]));
}

const plottedNumbers = [['psnr_rgb', 'PSNR, dB'], ['lpips', 'LPIPS'], ['ab_error', 'ab error'],
  ['colourfulness_difference', "colourfulness less the truth's"]];

// One plot per number: views along x, methods as colours; of the first seed.
function viewPlots(capture) {
  const shown = cells.filter((cell) => cell.capture === capture && cell.seed === cells[0].seed);
  const positions = Math.max(1, ...shown.map((cell) => cell.metrics.views.length));
  const legend = data.methods.map(({ name }) =>
    [make('span', { style: `color:${colorOf(name)}` }, '●'), ` ${name} \u00a0 `]);
  return [make('h3', {}, 'Each view'), make('p', {}, legend), plottedNumbers.map(([name, title]) =>
    plot(title, shown.flatMap(({ method, metrics }) => metrics.views.map((view, x) =>
      ({ method, label: view.view, x, y: view[name], spread: 0 }))).filter(({ y }) => y !== undefined), positions))];
}

// Means and confidence intervals over seeds; nothing with a single one.
function seedPlots(rows) {
  if (!rows.some((each) => each[columns[0].name]?.n > 1)) return [];
  return [make('h3', {}, 'Over seeds: mean and 95 % confidence interval'),
    columns.filter(({ better }) => better).map(({ name, title }) => plot(title, rows.flatMap((each, x) => each[name]
      ? [{ method: each.method, label: 'mean', x, y: each[name].mean, spread: each[name].ci95 ?? 0 }] : []), rows.length))];
}

const figure = (picture, caption) =>
  make('figure', {}, make('img', { alt: caption, src: picture }), make('figcaption', {}, caption));

// The pictures of a view: {name: picture}, in the order in which they are shown.
const picturesOf = ({ inputs, truths, methods }, v) => ({ input: inputs[v],
  ...Object.fromEntries(methods.filter(({ views }) => v < views.length).map(({ name, views }) => [name, views[v]])),
  ...(v < truths.length ? { truth: truths[v] } : {}) });

// Two pictures of one view, one over the other up to a handle.
function slider(capture) {
  const select = (values, chosen) =>
    make('select', {}, values.map((value) => make('option', value === chosen ? { selected: '' } : {}, value)));
  const names = Object.keys(picturesOf(capture, 0));
  const view = select(capture.views), left = select(names, 'input'), right = select(names, 'colornerf');
  const under = make('img', { alt: 'right' }), over = make('img', { alt: 'left', class: 'over' });
  const split = make('input', { type: 'range', value: 50, 'aria-label': 'where the pictures meet' });
  const show = () => {
    const pictures = picturesOf(capture, capture.views.indexOf(view.value));
    under.src = pictures[right.value] ?? '';
    over.src = pictures[left.value] ?? '';
    over.style.clipPath = `inset(0 ${100 - split.value}% 0 0)`;
  };
  for (const control of [view, left, right, split]) control.addEventListener('input', show);
  show();
  return make('div', {}, make('p', {}, 'View ', view, ' left ', left, ' right ', right),
    make('div', { class: 'slider' }, under, over, split));
}

function turntables(capture) {
  const strips = capture.methods.filter(({ turntable }) => turntable.length > 0)
    .map(({ name, turntable }) => ({ figure: figure(turntable[0], name), frames: turntable }));
  if (strips.length === 0) return [];
  const length = Math.max(...strips.map(({ frames }) => frames.length));
  const place = make('input', { type: 'range', min: 0, max: length - 1, value: 0 });
  const button = make('button', {}, 'Play');
  let at = 0, timer = null;
  const show = () => {
    for (const strip of strips) strip.figure.querySelector('img').src = strip.frames[at % strip.frames.length];
    place.value = at;
  };
  place.addEventListener('input', () => { at = Number(place.value); show(); });
  button.addEventListener('click', () => {
    clearInterval(timer);
    timer = timer ? null : setInterval(() => { at = (at + 1) % length; show(); }, 1000 / capture.frames_per_second);
    button.textContent = timer ? 'Stop' : 'Play';
  });
  return [make('h3', {}, 'Turntables'), make('p', {}, button, ' ', place),
    make('div', { class: 'pictures' }, strips.map((strip) => strip.figure))];
}

function galleries(capture) {
  const shown = capture.methods.filter((method) => method.galleries.length > 0);
  const sum = (own, name) => own.reduce((total, cell) => total + cell[name], 0);
  return shown.length === 0 ? [] : [make('h3', {}, 'Purification'), shown.map(({ name, galleries: pictures }) => {
    const own = cells.filter((cell) => cell.capture === capture.name && cell.method === name);
    const accepted = sum(own, 'accepted'), asked = accepted + sum(own, 'rejected');
    return make('details', {}, make('summary', {}, `${name}: ${accepted} of ${asked} answers accepted`),
      pictures.map(({ title, picture }) => figure(picture, title)));
  })];
}

function captureSection(capture) {
  const { rows } = data.table.tables.find((table) => table.capture === capture.name);
  return [make('h2', {}, capture.name), methodTable(rows), slider(capture), make('h3', {}, 'Held-out views'),
    capture.views.map((view, v) => [make('h4', {}, view), make('div', { class: 'pictures' },
      Object.entries(picturesOf(capture, v)).map(([name, picture]) => figure(picture, name)))]),
    turntables(capture), viewPlots(capture.name), seedPlots(rows), galleries(capture)];
}

function allCaptures() {
  if (data.captures.length < 2) return [];
  const { rows } = data.table.tables.at(-1);
  return [make('h2', {}, 'All captures'), methodTable(rows), seedPlots(rows)];
}

function duels() {
  if (data.table.duels.length === 0) return [];
  return [make('h2', {}, 'colornerf against the others'),
    make('p', {}, 'Pairs of equal capture and seed in which colornerf is better, and by how much on average (above 0: better).'),
    make('table', {}, row('th', ['Against', 'Number', 'Better in', 'Mean gain']),
      data.table.duels.map(({ against, column, wins, pairs, mean_gain: gain }) => {
        const { title, digits } = columns.find(({ name }) => name === column);
        return row('td', [against, title, `${wins} of ${pairs}`, signed(gain, digits + 1)]);
      }))];
}

function trainingTimes() {
  const races = data.table.training_times ?? [];
  if (races.length === 0) return [];
  const reached = (race) => race.reached > 0
    ? `${race.reached_after.toFixed(1)} (${race.reached} of ${race.seeds} seeds)` : 'never';
  return [make('h2', {}, 'Training times'),
    make('p', {}, 'On the same held-out pixels while they train: PSNR of luminance (dB) in stage 1, ab error in stage 2.'),
    make('div', { class: 'wide' }, make('table', {}, row('th', ['Capture', 'Stage', 'Hash grid, s', 'comes to', 'MLP, s',
      'comes to', 'as good after, s', "hash grid after 1/10 of the MLP's time"]),
    races.map((race) => row('td', [race.capture, race.stage, race.hash_grid.seconds.toFixed(1),
      race.hash_grid.value.toFixed(2), race.mlp.seconds.toFixed(1), race.mlp.value.toFixed(2), reached(race),
      race.hash_grid_after_tenth.toFixed(2)]))))];
}

const { colorizer, lpips, command_line: command } = data.table;
put('summary', 'Colorizer: ', make('code', {}, colorizer), `. LPIPS: ${lpips || 'not measured (--lpips-weights)'}. Made by `,
  make('code', {}, command), '.');
put('captures', allCaptures(), data.captures.map(captureSection));
put('duels', duels());
put('times', trainingTimes());
put('methods', data.methods.map(({ name, summary }) => make('li', {}, make('code', {}, name), `: ${summary}`)));
put('meanings', columns.map(({ title, help }) => make('li', {}, make('b', {}, title), `: ${help}`)));
