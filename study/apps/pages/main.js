// The participant's page: shows what the server says comes next, hands back what was done, and starts again from the
// server's word whenever anything is unclear. It decides nothing about the study.

import { watchAttention } from "./attention.js";
import { fromHex, surround } from "./colours.js";
import { ask, heading, sleep, status, top } from "./dom.js";
import { hasFrameCallback, refreshRate } from "./playing.js";
import * as screens from "./screens.js";
import { Refused, begin, hasKept, keepAlive, send, sendKept, study as getStudy } from "./server.js";
import { measure } from "./sizes.js";
import { trial } from "./trial.js";

const WITH_PROGRESS = ["trial", "feedback"];
const WITH_FILMS = ["trial", "instructions"];
const LAST = ["done", "declined", "full", "taken", "elsewhere"];

async function display() {
  return {
    user_agent: navigator.userAgent.slice(0, 400),
    viewport: [window.innerWidth, window.innerHeight],
    screen: [window.screen.width, window.screen.height],
    pixel_ratio: window.devicePixelRatio,
    refresh_hz: await refreshRate(),
    frame_callback: hasFrameCallback,
    touch: window.matchMedia("(pointer: coarse)").matches,
    reduced_motion: window.matchMedia("(prefers-reduced-motion: reduce)").matches,
  };
}

function parameters(study) {
  const link = new URLSearchParams(window.location.search);
  return Object.fromEntries(study.parameters.filter((name) => link.has(name)).map((name) => [name, link.get(name).slice(0, 400)]));
}

async function act(view, study, state) {
  const { texts } = study;
  if (view.kind === "trial") {
    const { message, films } = await trial(view, study, state.pauseOver, state.films);
    state.films = films;
    if (message.value === null && view.question.window_s !== null && message.shown.length > 0) status(texts.missed);
    // The pause begins with the answer, not with the server's word for it.
    state.pauseOver = sleep(view.pause_s * 1000);
    const next = await send("api/answer", message, texts.waiting);
    if (next.kind === "feedback" || next.kind === "trial") return next;
    await state.pauseOver;
    return next;
  }
  if (view.kind !== "feedback") status("");
  const pages = { consent: screens.consent, form: screens.form, instructions: screens.instructions };
  const message = await (pages[view.kind] ?? screens.read)(view, study);
  return send("api/done", { step: view.step, ...message }, texts.waiting);
}

function end(view, study) {
  const words = { declined: study.declined, full: study.texts.full, taken: study.texts.taken };
  if (view.kind === "done") screens.done(view, study);
  else screens.notice(words[view.kind]);
}

async function enter(study, force = false) {
  const link = { parameters: parameters(study), display: await display() };
  for (let view = await begin({ ...link, force }, study.texts.waiting); ; ) {
    if (view.kind !== "elsewhere") {
      return (await sendKept(study.texts.waiting)) ?? view;
    }
    top("", "");
    await ask([heading(study.texts.elsewhere)], [{ label: study.texts.take_over, value: true, quiet: true }], { enter: false });
    view = await begin({ ...link, force: true }, study.texts.waiting);
  }
}

async function run(study) {
  const state = { pauseOver: Promise.resolve(), films: null };
  let view = await enter(study);
  const stop = keepAlive(() => window.location.reload());
  while (!LAST.includes(view.kind)) {
    top(view.label ?? "", WITH_PROGRESS.includes(view.kind) ? screens.progress(view, study) : "");
    try {
      if (WITH_FILMS.includes(view.kind)) await measure(study);
      view = await act(view, study, state);
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      // Another tab, a restarted server or a withdrawn session: the server knows where we are.
      state.films = null;
      view = await enter(study);
    }
  }
  stop();
  end(view, study);
}

async function start() {
  const study = await getStudy();
  status("");
  surround(fromHex(study.background));
  if (!study.touch && window.matchMedia("(pointer: coarse)").matches) {
    screens.notice(study.texts.no_touch);
    return;
  }
  if (!document.createElement("video").canPlayType('video/mp4; codecs="avc1.42E01E"')) {
    screens.notice(study.texts.no_film);
    return;
  }
  watchAttention();
  window.addEventListener("beforeunload", (event) => {
    if (hasKept()) event.preventDefault();
  });
  try {
    await run(study);
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    status("");
    screens.notice(error.message); // nothing can be shown at this address
  }
}

// A page that the back button brings back as it was left shows what may have long been answered.
window.addEventListener("pageshow", (event) => {
  if (event.persisted) window.location.reload();
});

start();
