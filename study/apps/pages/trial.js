// A trial: films, gap, question, as the server's view says. Resolves with the message that is the answer.

import { attend, faults, filmsOn, unseen, visible } from "./attention.js";
import { fromHex, surround } from "./colours.js";
import { ask, element, heading, secondClick, show, sleep, status } from "./dom.js";
import { FilmFault, forget, load, loadAhead, release } from "./film.js";
import { play } from "./playing.js";
import { tell } from "./server.js";
import { stage } from "./sizes.js";

const MOST_RESTARTS = 3;

const NEAR = 12; // of 255: what decoding may change of a colour

// The page takes the colour that the browser makes of the films' background, to the last bit, so that nothing flashes.
// A busy browser may have no frame to draw yet, and draws black or nothing: only a colour near the stated one is taken.
export function matchBackground(video, study) {
  const canvas = element("canvas", { width: 1, height: 1 });
  const context = canvas.getContext("2d");
  context.drawImage(video, 0, 0, 1, 1, 0, 0, 1, 1);
  const colour = [...context.getImageData(0, 0, 1, 1).data];
  const stated = [...fromHex(study.background), 255];
  if (colour.every((value, i) => Math.abs(value - stated[i]) <= NEAR)) surround(colour.slice(0, 3));
}

async function loadAll(view, study, onFault) {
  const place = stage(study);
  place.setAttribute("aria-label", study.texts.wait);
  show([place], { trial: true });
  const timer = setTimeout(() => status(study.texts.wait), 600);
  const videos = [];
  try {
    for (const film of view.films) {
      const video = await load(film, view.fps, (why, attempt) => onFault(film, why, attempt));
      place.append(video);
      videos.push(video);
    }
  } catch (error) {
    videos.forEach(release);
    throw error;
  } finally {
    clearTimeout(timer);
    status("");
  }
  return { place, videos };
}

class Unseen extends Error {} // films that were played to nobody

// How the films of a trial are shown, by its layout: resolves with how each was shown, and when the last one ended.
const LAYOUTS = { "one after another": inTurn };

async function inTurn(view, videos, restarts) {
  const shown = [];
  let last = performance.now();
  for (const [index, film] of view.films.entries()) {
    if (index > 0) await sleep(view.gap_s * 1000);
    videos[index].classList.add("now");
    const { last: lastFrame, ...how } = await play(videos[index], film, view.fps);
    videos[index].classList.remove("now");
    if (restarts && unseen()) throw new Unseen();
    last = lastFrame;
    shown.push({ slot: film.slot, ...how });
  }
  return { shown, last };
}

async function showFilms(view, study, { restarts, pauseOver, onFault }) {
  const { place, videos } = await loadAll(view, study, onFault);
  // `scale` is that of the film's own pixels in pixels of the page.
  const size = { ...place.size, scale: place.size.width_css / study.size[0] };
  matchBackground(videos[0], study);
  await pauseOver;
  await visible();
  if (restarts === MOST_RESTARTS) attend();
  filmsOn(true);
  try {
    return { ...(await LAYOUTS[view.layout](view, videos, restarts)), size };
  } finally {
    filmsOn(false);
    videos.forEach(release);
    place.remove();
  }
}

// What is answered, by kind: each part calls `chosen` with the value and the time of the key or click. It gives what
// stands above the words at the ends of a scale, and what stands below them.
const ANSWERS = { word: options, point: options, slider };

function options(question, study, chosen) {
  const row = element("div", { class: "buttons centre", role: "group", "aria-label": question.text || question.item });
  for (const option of question.options) {
    const hint = option.key && option.key !== option.label ? study.texts.press.replace("{key}", option.key.toUpperCase()) : "";
    const words = [element("span", {}, option.label), hint ? element("small", {}, hint) : null].filter(Boolean);
    const button = element("button", {
      type: "button",
      class: question.kind === "point" ? "answer point" : "answer",
      "data-value": option.value,
      "aria-keyshortcuts": option.key || null,
      onclick: (event) => secondClick(event) || chosen(option.value, event.timeStamp),
    });
    button.append(...words);
    row.append(button);
  }
  return [row];
}

// A slider of 0 to 100, whose knob shows once it was moved: no place is suggested.
function track(label, ticks, moved) {
  const input = element("input", { type: "range", min: "0", max: "100", value: "50", class: "untouched", "aria-label": label, "aria-valuetext": "–" });
  const touched = () => {
    input.classList.remove("untouched");
    input.setAttribute("aria-valuetext", input.value);
    moved();
  };
  for (const kind of ["input", "click"]) input.addEventListener(kind, touched);
  const marks = ticks ? element("div", { class: "ticks", "aria-hidden": "true" }, ...Array.from({ length: 11 }, () => element("i"))) : null;
  return element("div", { class: "track" }, input, marks);
}

function slider(question, study, chosen) {
  const made = track(question.text, question.slider === "ticks", () => (button.disabled = false));
  const value = () => made.querySelector("input").value;
  const button = element("button", { type: "button", disabled: true, onclick: (event) => secondClick(event) || chosen(value(), event.timeStamp) }, study.texts.go_on);
  return [made, element("div", { class: "buttons centre" }, button)];
}

// Asks; resolves with the value (null where the window closed first) and the time of the key or button. The window is
// open for its time from `from` on, which is also where the answer's time begins (null: from when it is asked).
function question(asked, study, from) {
  return new Promise((resolve) => {
    const controller = new AbortController();
    const keys = new Map(asked.options.filter((option) => option.key).map((option) => [option.key, option.value]));
    let timer = 0;
    const finish = (value, at) => {
      if (controller.signal.aborted) return;
      controller.abort();
      clearTimeout(timer);
      for (const button of document.querySelectorAll("main button, main input")) {
        button.disabled = true;
        button.setAttribute("aria-pressed", String(button.dataset.value === value));
      }
      resolve({ value, at, began });
    };
    const [scale, below = ""] = ANSWERS[asked.kind](asked, study, finish);
    const named = asked.middle ? [asked.low, asked.middle, asked.high] : [asked.low, asked.high];
    const ends = named.some(Boolean) ? element("div", { class: asked.middle ? "ends thirds" : "ends" }, ...named.map((words) => element("span", {}, words))) : null;
    show([heading(asked.text, { class: "question" }), element("div", { class: "scale" }, scale, ends), below], { trial: true });
    const asks = performance.now();
    const began = from ?? asks;
    document.addEventListener(
      "keydown",
      (event) => {
        // A key that is held down, or was pressed before the question stood there, answers nothing.
        if (event.repeat || event.timeStamp < asks || event.ctrlKey || event.altKey || event.metaKey) return;
        const value = keys.get(event.key.toLowerCase());
        if (value === undefined) return;
        event.preventDefault();
        finish(value, event.timeStamp);
      },
      { signal: controller.signal },
    );
    const left = asked.window_s === null ? null : began + asked.window_s * 1000 - asks;
    if (left !== null) timer = setTimeout(() => finish(null, performance.now()), left);
  });
}

// Films that can't be shown: try again, or go on without. Nothing hangs, and the fault is on record.
async function filmFault(study) {
  const { texts } = study;
  return ask([heading(texts.film_fault)], [
    { label: texts.try_again, value: "again" },
    { label: texts.pass_over, value: "skip", quiet: true },
  ]);
}

// Shows the films until they were shown, or given up: null then.
async function shownFilms(view, study, pauseOver) {
  const onFault = (film, why, attempt) => tell("fault", { what: why, trial: view.trial, slot: film.slot, try: attempt });
  for (let restarts = MOST_RESTARTS; ; ) {
    try {
      return await showFilms(view, study, { restarts, pauseOver, onFault });
    } catch (error) {
      if (!(error instanceof FilmFault || error instanceof Unseen)) throw error;
      // A hidden tab or a closed lid stops films: they start again when somebody looks, and the trial stays flagged.
      if (unseen() && restarts > 0) {
        restarts -= 1;
        tell("interrupted", { trial: view.trial, attempt: view.attempt, how: faults().join(", ") });
        await visible();
        continue;
      }
      forget(view.films);
      tell("fault", { what: error.why, trial: view.trial });
      if ((await filmFault(study)) === "skip") return null;
    }
  }
}

// `earlier` is how the films of this trial were shown, where this view asks a further question about them.
export async function trial(view, study, pauseOver, earlier) {
  const base = { trial: view.trial, attempt: view.attempt, item: view.question.item };
  const withFilms = view.films.length > 0;
  const films = withFilms ? await shownFilms(view, study, pauseOver) : earlier;
  if (films === null && withFilms) {
    return { message: { ...base, value: null, response_s: null, shown_well: false, shown: [] }, films };
  }
  loadAhead(view.ahead);
  // The last film's last frame is when the participant has seen everything; a further question begins with itself.
  const { value, at, began } = await question(view.question, study, withFilms ? films.last : null);
  const why = faults().join(", ");
  const message = {
    ...base,
    value,
    response_s: value === null ? null : Math.max(0, (at - began) / 1000),
    shown_well: why === "" && (films?.shown ?? []).every((one) => one.shown_well),
    shown: withFilms ? films.shown : [],
    timing: { last_frame_ms: began, answer_ms: at, time_origin_ms: performance.timeOrigin, faults: why, ...(films?.size ?? {}) },
  };
  return { message, films };
}
