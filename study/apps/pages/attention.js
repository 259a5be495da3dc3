// Whether the participant could see what was shown, and the page could show it. A trial in which a page was hidden,
// left, or stood still as under a closed lid is flagged, with the reason.

import { tell } from "./server.js";

const BEAT_MS = 250;
const STOPPED_MS = 1500; // between two beats: the page, the browser or the whole machine stood still

const state = { faults: [], filmsOn: false, unseen: false, beat: 0, clock: 0 };

function fault(why) {
  if (!state.faults.includes(why)) state.faults.push(why);
}

// Machines that sleep stop one clock or the other, depending on the system: the one that went on tells.
function beat() {
  const [now, clock] = [performance.now(), Date.now()];
  const still = Math.max(now - state.beat, clock - state.clock);
  Object.assign(state, { beat: now, clock });
  if (still < STOPPED_MS || document.hidden) return;
  fault("stood still");
  state.unseen = true;
  tell("interrupted", { how: "stood still", seconds: Math.round(still) / 1000, at_ms: now });
}

export function watchAttention() {
  Object.assign(state, { beat: performance.now(), clock: Date.now() });
  setInterval(beat, BEAT_MS);
  document.addEventListener("visibilitychange", () => {
    // A hidden page's timers are slowed down on purpose: beats are counted anew once it is seen again.
    Object.assign(state, { beat: performance.now(), clock: Date.now() });
    fault("hidden");
    state.unseen = true;
    tell(document.hidden ? "focus-lost" : "focus-back", { how: "visibility", at_ms: performance.now() });
  });
  window.addEventListener("blur", () => {
    if (state.filmsOn) fault("focus lost");
    tell("focus-lost", { how: "blur", at_ms: performance.now() });
  });
  window.addEventListener("focus", () => tell("focus-back", { how: "focus", at_ms: performance.now() }));
  let timer = 0;
  window.addEventListener("resize", () => {
    clearTimeout(timer);
    if (state.filmsOn) fault("resized");
    timer = setTimeout(() => tell("resized", { width: window.innerWidth, height: window.innerHeight }), 500);
  });
}

// A trial begins: what was before does not count against it.
export function attend() {
  state.faults = document.hidden ? ["hidden"] : [];
}

export function filmsOn(on) {
  state.filmsOn = on;
  document.body.classList.toggle("showing", on); // nothing but the film is on the page
  if (on) state.unseen = document.hidden;
}

// Whether nobody can have seen all of what was shown since the films began.
export function unseen() {
  beat();
  return state.unseen;
}

// Why the trial is flagged; none where it is not.
export function faults() {
  beat();
  return [...state.faults];
}

export function visible() {
  if (!document.hidden) return Promise.resolve();
  return new Promise((resolve) => {
    const controller = new AbortController();
    const look = () => {
      if (document.hidden) return;
      controller.abort();
      resolve();
    };
    document.addEventListener("visibilitychange", look, { signal: controller.signal });
  });
}
