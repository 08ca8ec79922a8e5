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
  if (Object.keys(parts).some((name) => name.startsWith("bodies/"))) nameRobots();
}

// Where a robot's name may stand: x and y in radii of the body, shift of the text, and its anchor.
const SIDES = {
  below: [0, 1, "0", "1.2em", "middle"],
  above: [0, -1, "0", "-0.5em", "middle"],
  right: [1, 0, "0.4em", "0.35em", "start"],
  left: [-1, 0, "-0.4em", "0.35em", "end"],
};
const sides = new Map(); // where each robot's name stood last

// Names of robots that stand close make way for each other, and stay where they are if they can.
function nameRobots() {
  const robots = [...document.querySelectorAll("#bodies > g")];
  const obstacles = document.querySelectorAll("#bodies circle, #ground .thing");
  const taken = [...obstacles].map((each) => each.getBoundingClientRect());
  for (const robot of robots) {
    const text = robot.querySelector("text");
    if (!text) continue;
    const last = sides.get(robot.dataset.key) ?? "below";
    const found = [last, ...Object.keys(SIDES)]
      .map((side) => ({ side, hidden: hidden(stand(text, robot, side), taken) }))
      .reduce((best, each) => (each.hidden < best.hidden ? each : best));
    sides.set(robot.dataset.key, found.side);
    taken.push(stand(text, robot, found.side));
  }
}

function stand(text, robot, side) {
  const radius = Number(robot.querySelector("circle").getAttribute("r"));
  const [, x, y] = robot.querySelector("g[transform]").getAttribute("transform").match(/translate\((\S+) (\S+)\)/);
  const [right, down, dx, dy, anchor] = SIDES[side];
  text.setAttribute("x", Number(x) + right * radius);
  text.setAttribute("y", Number(y) + down * radius);
  text.setAttribute("dx", dx);
  text.setAttribute("dy", dy);
  text.style.textAnchor = anchor;
  return text.getBoundingClientRect();
}

// The area of a box that others cover, and that lies outside of the drawing.
function hidden(box, taken) {
  const drawing = at("arena").getBoundingClientRect();
  const area = (other) => {
    const width = Math.min(box.right, other.right) - Math.max(box.left, other.left);
    const height = Math.min(box.bottom, other.bottom) - Math.max(box.top, other.top);
    return Math.max(width, 0) * Math.max(height, 0);
  };
  const all = box.width * box.height;
  return taken.reduce((sum, other) => sum + area(other), all - area(drawing));
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

// Fold and unfold the cards anew, such as when the window has become wide.
export function foldAll() {
  document.querySelectorAll("details.card").forEach((card) => {
    card.open = !card.hasAttribute("data-empty") && !folded().has(card.id);
  });
}

const KEY = "macor-folded";
export const PHONE = matchMedia("(max-width: 699px)");
const NARROW = ["columns-card", "health-card", "line-card", "rewards-card"];

export function folded() {
  const kept = localStorage.getItem(KEY);
  if (kept !== null) return new Set(JSON.parse(kept));
  return new Set(PHONE.matches ? NARROW : []);
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
  if (svg.id === "arena") nameRobots();
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
