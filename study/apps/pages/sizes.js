// How large films are shown: as the protocol states, in whole pixels of the screen; and what is measured for that.
// study/experiment/picture_size.py computes the same for the window.

import { ask, element, heading, paragraph, show } from "./dom.js";
import { tell } from "./server.js";

const CARD_CM = 8.56; // width of a bank card: ISO/IEC 7810, format ID-1
const CARD_SHAPE = 85.6 / 53.98;
// From the point that is looked at to the middle of the blind spot (Li et al. 2020, "virtual chinrest").
const BLIND_SPOT = (13.5 * Math.PI) / 180;
const BLIND_TRIALS = 5;
const DOT_CM_A_SECOND = 3;
const KEPT = "segue-screen";

let measured = null; // { px_per_cm, distance_cm }, pixels of the screen

const even = (pixels) => Math.floor(pixels / 2 + 1e-6) * 2;

// Pixels of the screen and of the page, and degrees where they are known.
export function pictureSize(study) {
  const { height_share, height_degrees, distance_cm } = study.screen;
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = study.size;
  const screenHeight = window.screen.height * ratio;
  const perCm = measured?.px_per_cm ?? null;
  const distance = measured?.distance_cm ?? distance_cm;
  const spanned = perCm && distance && height_degrees;
  const wanted = spanned ? 2 * distance * Math.tan((height_degrees * Math.PI) / 360) * perCm : height_share * screenHeight;
  const scale = Math.min(wanted / height, (window.innerWidth * ratio) / width, (window.innerHeight * ratio) / height);
  const [widthPx, heightPx] = [even(width * scale), even(height * scale)];
  const degrees = perCm && distance ? (360 / Math.PI) * Math.atan(heightPx / perCm / 2 / distance) : null;
  return {
    width_px: widthPx,
    height_px: heightPx,
    width_css: widthPx / ratio,
    height_css: heightPx / ratio,
    height_degrees: degrees === null ? null : Math.round(degrees * 1000) / 1000,
    screen_height_px: Math.round(screenHeight),
    px_per_cm: perCm,
    distance_cm: distance,
  };
}

// Pixels of the page beside films that are shown at once: the question and buttons, and what is under each film.
const BESIDES = { slider: [210, 96], others: [310, 12], narrow: [440, 12] };

// How large films are that are shown at once: in as many columns as make them largest, and no larger than a single one.
export function cellSize(study, count, slider) {
  const size = pictureSize(study);
  const ratio = window.devicePixelRatio || 1;
  const { innerWidth, innerHeight } = window;
  const [room, under] = BESIDES[slider ? "slider" : innerWidth < 640 ? "narrow" : "others"];
  const scaleOf = (columns) => {
    const rows = Math.ceil(count / columns);
    const high = ((innerHeight - room) / rows - under) * ratio;
    const wide = ((innerWidth - 24) / columns - 16) * ratio;
    return Math.min(high / size.height_px, wide / size.width_px, 1);
  };
  // Left and right stay left and right, however narrow the page is.
  const possible = Array.from({ length: count }, (_, at) => at + 1).filter((columns) => slider || columns === count);
  const best = possible.reduce((one, other) => (scaleOf(other) > scaleOf(one) ? other : one));
  const scale = Math.max(scaleOf(best), 0.05);
  const [width, height] = [even(size.width_px * scale), even(size.height_px * scale)];
  const degrees = size.height_degrees === null ? null : Math.round(size.height_degrees * (height / size.height_px) * 1000) / 1000;
  return { ...size, columns: best, width_px: width, height_px: height, width_css: width / ratio, height_css: height / ratio, height_degrees: degrees };
}

// Where a film is shown: in the middle of the page, from pixel to pixel of the screen, so that none is blurred.
export function stage(study) {
  const size = pictureSize(study);
  const ratio = window.devicePixelRatio || 1;
  const made = element("div", { class: "stage", role: "group", "data-focus": true, tabindex: "-1" });
  const middle = (room, own) => `${Math.max(0, Math.round((room * ratio - own) / 2)) / ratio}px`;
  made.style.left = middle(window.innerWidth, size.width_px);
  made.style.top = middle(window.innerHeight, size.height_px);
  made.style.width = `${size.width_css}px`;
  made.style.height = `${size.height_css}px`;
  made.size = size;
  return made;
}

const needed = ({ height_degrees, ask_distance }) => height_degrees !== null || ask_distance !== "no";

// Has the screen measured once, where the protocol needs it; kept for a page that is loaded again.
export async function measure(study) {
  if (!needed(study.screen) || measured) return;
  measured = kept();
  if (measured) return;
  const perCm = await card(study);
  const distance = await DISTANCES[study.screen.ask_distance](study, perCm);
  measured = { px_per_cm: Math.round(perCm * 1e4) / 1e4, distance_cm: distance === null ? null : Math.round(distance * 10) / 10 };
  try {
    sessionStorage.setItem(KEPT, JSON.stringify(measured));
  } catch {
    // asked again after a reload
  }
  tell("screen-measured", { ...measured, asked: study.screen.ask_distance });
}

function kept() {
  try {
    return JSON.parse(sessionStorage.getItem(KEPT));
  } catch {
    return null;
  }
}

// A frame that is made as large as a card held against the screen; resolves with pixels of the screen a centimetre.
async function card(study) {
  const { texts, screen } = study;
  const frame = element("div", { class: "card" });
  const most = Math.min(window.innerWidth * 0.9, 900);
  const slider = element("input", { type: "range", min: "120", max: String(Math.floor(most)), step: "1", value: "300", "aria-label": texts.card });
  const fit = () => {
    frame.style.width = `${slider.value}px`;
    frame.style.height = `${slider.value / CARD_SHAPE}px`;
  };
  slider.addEventListener("input", fit);
  fit();
  const keep = screen.distance_cm !== null && screen.ask_distance === "no" ? [paragraph(texts.distance_keep.replace("{cm}", screen.distance_cm))] : [];
  await ask([heading(texts.card), frame, slider, ...keep], [{ label: texts.go_on, value: true }], { enter: false });
  return (Number(slider.value) * (window.devicePixelRatio || 1)) / CARD_CM;
}

const DISTANCES = { no: async () => null, typed: typedDistance, "blind-spot": blindSpotDistance };

async function typedDistance(study) {
  const { texts } = study;
  const input = element("input", { type: "number", min: "10", max: "1000", step: "any", inputmode: "numeric", "aria-label": texts.distance_ask });
  for (;;) {
    await ask([heading(texts.distance_ask), input], [{ label: texts.go_on, value: true }], { enter: false });
    if (input.validity.valid && input.value) return Number(input.value);
    input.setAttribute("aria-invalid", "true");
  }
}

// A dot moves away from a square, to the left, until the left eye no longer sees it.
async function blindSpotDistance(study, perCm) {
  const { texts } = study;
  const ratio = window.devicePixelRatio || 1;
  await ask([heading(texts.blind_spot)], [{ label: texts.go_on, value: true }]);
  const found = [];
  while (found.length < BLIND_TRIALS) found.push((await vanished((DOT_CM_A_SECOND * perCm) / ratio)) * ratio);
  return found.reduce((sum, one) => sum + one, 0) / found.length / perCm / Math.tan(BLIND_SPOT);
}

// Resolves with the dot's distance from the square, in pixels of the page, when a key says that it is gone.
function vanished(speed) {
  return new Promise((resolve) => {
    const [square, dot] = [element("div", { class: "fixation" }), element("div", { class: "dot" })];
    show([element("div", { class: "field", role: "group", "data-focus": true, tabindex: "-1" }, square, dot)], { trial: true });
    const began = performance.now();
    const controller = new AbortController();
    const away = () => ((performance.now() - began) / 1000) * speed;
    const move = () => {
      if (controller.signal.aborted) return;
      const room = square.offsetLeft - dot.offsetWidth;
      dot.style.left = `${square.offsetLeft - (away() % Math.max(room, 1))}px`;
      requestAnimationFrame(move);
    };
    const gone = (event) => {
      if (event.repeat || (event.type === "keydown" && event.key !== " ")) return;
      event.preventDefault();
      controller.abort();
      resolve(square.offsetLeft - dot.offsetLeft);
    };
    document.addEventListener("keydown", gone, { signal: controller.signal });
    document.addEventListener("pointerdown", gone, { signal: controller.signal });
    requestAnimationFrame(move);
  });
}
