// Puts the parts that come into the page, and draws the camera's pictures.

const SVG = "http://www.w3.org/2000/svg";
const at = (id) => document.getElementById(id);

let eye = null; // the mirror's place in a picture, and the panorama's size
let places = null; // for each pixel of the panorama, where it is in the picture

// A part's name is an element's id, `id@attribute`, or `id/key` for a child.
export function put(parts, special) {
  for (const [name, part] of Object.entries(parts)) {
    if (special[name]) special[name](part);
    else if (name.includes("@")) attribute(...name.split("@"), part);
    else if (name.includes("/")) child(name, part);
    else if (at(name)) at(name).innerHTML = part ?? "";
  }
}

function attribute(id, name, value) {
  const element = at(id);
  if (!element) return;
  if (value === null) element.removeAttribute(name);
  else element.setAttribute(name, value);
  if (name === "viewBox") measure(element);
  if (name === "data-empty") fold(element, value);
  if (name === "data-rows") element.style.setProperty("--rows", value);
}

function child(name, part) {
  const cut = name.indexOf("/");
  const parent = at(name.slice(0, cut));
  const key = name.slice(cut + 1);
  let element = [...parent.children].find((each) => each.dataset.key === key);
  if (part === null) {
    element?.remove();
    return;
  }
  if (!element) {
    element = document.createElementNS(SVG, "g");
    element.dataset.key = key;
    parent.append(element);
  }
  element.innerHTML = part;
}

// A card with nothing to show folds away; one that its reader has folded stays so.
function fold(card, empty) {
  const why = card.querySelector(".none");
  if (why) why.textContent = empty ?? "";
  card.open = empty === null && !folded().has(card.id);
}

const KEY = "macor-folded";
const NARROW = ["columns-card", "health-card", "line-card", "rewards-card"];

export function folded() {
  const kept = localStorage.getItem(KEY);
  if (kept !== null) return new Set(JSON.parse(kept));
  return new Set(matchMedia("(max-width: 699px)").matches ? NARROW : []);
}

export function keepFolded(card) {
  const closed = folded();
  if (card.open) closed.delete(card.id);
  else closed.add(card.id);
  localStorage.setItem(KEY, JSON.stringify([...closed]));
}

// Text in a drawing in millimetres is as large as all other text.
export function measure(svg) {
  const box = svg.viewBox.baseVal;
  if (!svg.clientWidth || !svg.clientHeight || !box.width) return;
  const mm = Math.max(box.width / svg.clientWidth, box.height / svg.clientHeight);
  svg.style.setProperty("--mm", mm);
}

export function cells(value) {
  const all = document.querySelectorAll("#columns i");
  const order = new Map(value?.ahead ?? []);
  all.forEach((cell, k) => {
    const level = value?.levels[k] ?? "0";
    if (cell.dataset.l !== level) cell.dataset.l = level;
    const text = order.has(k) ? String(order.get(k)) : "";
    if (cell.textContent !== text) cell.textContent = text;
    cell.className = (order.has(k) ? "ahead" : "") + (value?.now === k ? " now" : "");
  });
}

export function look(geometry) {
  eye = geometry;
  const { columns, rows, x, y, inner, outer } = eye;
  places = new Float32Array(2 * columns * rows);
  for (let row = 0; row < rows; row++) {
    const radius = outer - ((row + 0.5) * (outer - inner)) / rows;
    for (let column = 0; column < columns; column++) {
      // azimuth counts counter-clockwise from straight ahead, which is up in the mirror image
      const azimuth = Math.PI - ((column + 0.5) * 2 * Math.PI) / columns;
      const k = 2 * (row * columns + column);
      places[k] = x - radius * Math.sin(azimuth);
      places[k + 1] = y - radius * Math.cos(azimuth);
    }
  }
}

export async function picture(blob) {
  const image = await createImageBitmap(blob);
  const mirror = at("mirror");
  if (mirror.width !== image.width || mirror.height !== image.height) {
    mirror.width = image.width;
    mirror.height = image.height;
  }
  const context = mirror.getContext("2d", { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  if (!eye || eye.width !== image.width || eye.height !== image.height) return;
  const from = new Uint32Array(context.getImageData(0, 0, image.width, image.height).data.buffer);
  const panorama = at("panorama");
  const drawn = panorama.getContext("2d");
  const flat = drawn.createImageData(eye.columns, eye.rows);
  const to = new Uint32Array(flat.data.buffer);
  for (let k = 0; k < to.length; k++) {
    const x = Math.min(Math.max(Math.round(places[2 * k]), 0), image.width - 1);
    const y = Math.min(Math.max(Math.round(places[2 * k + 1]), 0), image.height - 1);
    to[k] = from[y * image.width + x];
  }
  drawn.putImageData(flat, 0, 0);
}
