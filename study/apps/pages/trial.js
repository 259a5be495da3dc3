// A trial: films, gap, question, as the server's view says. Resolves with the message that is the answer.

import { attend, faults, filmsOn, unseen, visible } from "./attention.js";
import { fromHex, surround } from "./colours.js";
import { ask, drawn, element, heading, secondClick, show, sleep, status } from "./dom.js";
import { FilmFault, forget, load, loadAhead, release, seek } from "./film.js";
import { median, play } from "./playing.js";
import { tell } from "./server.js";
import { cellSize, stage } from "./sizes.js";

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

async function loadAll(view, study, layout, onFault) {
  const place = layout.place(view, study);
  show([place], { trial: true });
  const timer = setTimeout(() => status(study.texts.wait), 600);
  const videos = [];
  try {
    for (const film of view.films) {
      const video = await load(film, view.fps, (why, attempt) => onFault(film, why, attempt));
      place.hold(video);
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

// How the films of a trial are shown, by its layout: the place for them, and how they are played, which resolves with how
// each was shown and when the last one ended. Those that `stay` are there while the question is asked.
const LAYOUTS = { "one after another": { place: single, play: inTurn, stay: false }, "side by side": { place: cells, play: together, stay: true } };

function single(view, study) {
  const place = stage(study);
  place.setAttribute("aria-label", study.texts.wait);
  place.hold = (video) => place.append(video);
  return place;
}

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

// A grid of films, under each its letter and room for a slider; where both are compared there is neither.
function cells(view, study) {
  const slider = view.question.kind === "slider";
  const films = view.films.map(() => element("div", { class: "film" }));
  const made = films.map((film, at) => element("div", { class: "cell" }, film, slider ? element("b", {}, "ABCDEF"[at]) : null));
  const grid = element("div", { class: "grid" }, ...made);
  const place = element("div", { class: "together", role: "group", "data-focus": true, tabindex: "-1" }, grid);
  const fit = () => {
    const { columns, ...size } = cellSize(study, films.length, slider);
    grid.style.gridTemplateColumns = `repeat(${columns}, auto)`;
    for (const film of films) Object.assign(film.style, { width: `${size.width_css}px`, height: `${size.height_css}px` });
    place.size = size;
  };
  window.addEventListener("resize", fit);
  fit();
  let next = 0;
  return Object.assign(place, { cells: made, hold: (video) => films[next++].append(video), gone: () => window.removeEventListener("resize", fit) });
}

const MOST_APART = 1; // frames between films that start together

// All films at once. Each one's frames tell when its first one was due; how far that is from the earliest is kept.
async function together(view, videos, restarts) {
  for (const video of videos) video.classList.add("now");
  await drawn();
  if (videos.some((video) => video.currentTime > 0)) await Promise.all(videos.map((video) => seek(video, 0)));
  const all = await Promise.all(videos.map((video, at) => play(video, view.films[at], view.fps)));
  if (restarts && unseen()) throw new Unseen();
  const began = all.map(({ times_ms, frames }) => median(times_ms.map((time, at) => time - (frames[at] * 1000) / view.fps).slice(1)));
  const first = Math.min(...began);
  const apart = began.map((one) => (Number.isFinite(one) ? Math.round(((one - first) * view.fps) / 10) / 100 : null));
  const close = apart.every((frames) => frames === null || frames <= MOST_APART);
  const shown = all.map(({ last, ...how }, at) => ({ slot: view.films[at].slot, ...how, apart_frames: apart[at], shown_well: how.shown_well && close }));
  return { shown, last: Math.max(...all.map((one) => one.last)) };
}

async function showFilms(view, study, { restarts, pauseOver, onFault }) {
  const layout = LAYOUTS[view.layout];
  const { place, videos } = await loadAll(view, study, layout, onFault);
  const away = () => {
    videos.forEach(release);
    place.gone?.();
    place.remove();
  };
  // `scale` is that of the film's own pixels in pixels of the page.
  const size = { ...place.size, scale: place.size.width_css / study.size[0] };
  matchBackground(videos[0], study);
  await pauseOver;
  await visible();
  if (restarts === MOST_RESTARTS) attend();
  let plays = 0;
  const once = async (left) => {
    filmsOn(true);
    try {
      plays += 1;
      const { shown, last } = await layout.play(view, videos, left);
      // Of a film that is seen again, what its frames amount to is kept, not each of them.
      const kept = plays > 1 ? { times_ms: [], frames: [] } : {};
      return { shown: shown.map((one) => ({ ...one, ...kept, play: plays })), last };
    } finally {
      filmsOn(false);
    }
  };
  try {
    const films = { ...(await once(restarts)), size, away: () => {} };
    if (!layout.stay) return films;
    return { ...films, place, away, again: () => once(0) };
  } catch (error) {
    away();
    throw error;
  } finally {
    if (!layout.stay) away();
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
  // The knob that is not seen yet lies in the middle all the same, and would take every press near there for its own.
  input.addEventListener("pointerdown", (event) => {
    if (!input.classList.contains("untouched")) return;
    const { left, width } = input.getBoundingClientRect();
    const knob = 1.5 * parseFloat(getComputedStyle(document.documentElement).fontSize);
    input.value = Math.round((100 * (event.clientX - left - knob / 2)) / (width - knob));
    touched();
  });
  const marks = ticks ? element("div", { class: "ticks", "aria-hidden": "true" }, ...Array.from({ length: 11 }, () => element("i"))) : null;
  return element("div", { class: "track" }, input, marks);
}

// One slider, or one under each film that is on the page.
function slider(question, study, chosen, place) {
  const cells = place?.cells ?? [null];
  const left = () => tracks.some((one) => one.querySelector(".untouched"));
  const label = (at) => (cells[at] ? `${"ABCDEF"[at]}: ${question.text}` : question.text);
  const tracks = cells.map((_, at) => track(label(at), question.slider === "ticks", () => (button.disabled = left())));
  const value = () => tracks.map((one) => one.querySelector("input").value).join(" ");
  const button = element("button", { type: "button", disabled: true, onclick: (event) => secondClick(event) || chosen(value(), event.timeStamp) }, study.texts.go_on);
  if (place) cells.forEach((cell, at) => cell.append(tracks[at], ends(question) ?? ""));
  return [place ? "" : tracks[0], button];
}

function ends({ low, middle, high }) {
  const named = middle ? [low, middle, high] : [low, high];
  return named.some(Boolean) ? element("div", { class: middle ? "ends thirds" : "ends" }, ...named.map((words) => element("span", {}, words))) : null;
}

// Asks; resolves with the value (null where the window closed first) and the time of the key or button. The window is
// open for its time from where films ended, which is also where the answer's time begins (without them from when it is
// asked). Films that are still on the page can be played again, as often as the protocol allows.
function question(asked, study, films) {
  return new Promise((resolve) => {
    const controller = new AbortController();
    const keys = new Map(asked.options.filter((option) => option.key).map((option) => [option.key, option.value]));
    let [timer, busy, left, shown] = [0, false, asked.replays, []];
    const held = new Map();
    const lock = (locked) => {
      busy = locked;
      for (const one of document.querySelectorAll("main button, main input")) {
        if (locked) held.set(one, one.disabled);
        one.disabled = locked || held.get(one);
      }
    };
    const finish = (value, at) => {
      if (controller.signal.aborted || busy) return;
      controller.abort();
      clearTimeout(timer);
      for (const button of document.querySelectorAll("main button, main input")) {
        button.disabled = true;
        if (button.dataset.value !== undefined) button.setAttribute("aria-pressed", String(button.dataset.value === value));
      }
      resolve({ value, at, began, shown });
    };
    const [scale, go = null] = ANSWERS[asked.kind](asked, study, finish, films?.place);
    const again = films?.again && left > 0 ? element("button", { type: "button", class: "quiet", onclick: (event) => secondClick(event) || replay() }, "") : null;
    const named = () => again && (again.textContent = `${study.texts.play_again} (${left})`);
    const buttons = again || go ? element("div", { class: "buttons centre" }, again, go) : "";
    const scaled = element("div", { class: "scale" }, scale, films?.place && asked.kind === "slider" ? null : ends(asked));
    named();
    if (films?.place) films.place.append(heading(asked.text, { class: "question" }), scaled, buttons);
    else show([heading(asked.text, { class: "question" }), scaled, buttons], { trial: true });
    if (films?.place) films.place.prepend(films.place.querySelector("h1"));
    const asks = performance.now();
    let began = films?.last ?? asks;
    const opens = () => {
      const rest = asked.window_s === null ? null : began + asked.window_s * 1000 - performance.now();
      if (rest !== null) timer = setTimeout(() => finish(null, performance.now()), rest);
    };
    const replay = async () => {
      clearTimeout(timer);
      lock(true);
      left -= 1;
      try {
        const played = await films.again();
        shown.push(...played.shown);
        began = played.last;
      } catch (error) {
        if (!(error instanceof FilmFault)) throw error;
        tell("fault", { what: error.why, play: asked.replays - left + 1 });
        began = performance.now();
      }
      named();
      lock(false);
      if (again && left === 0) again.disabled = true;
      opens();
    };
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
    opens();
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
  const { value, at, began, shown } = await question(view.question, study, withFilms ? films : null);
  films?.away();
  const why = faults().join(", ");
  const every = withFilms ? [...films.shown, ...shown] : [];
  const message = {
    ...base,
    value,
    response_s: value === null ? null : Math.max(0, (at - began) / 1000),
    shown_well: why === "" && (films?.shown ?? []).every((one) => one.shown_well),
    shown: every,
    timing: { last_frame_ms: began, answer_ms: at, time_origin_ms: performance.timeOrigin, faults: why, ...(films?.size ?? {}) },
  };
  return { message, films };
}
