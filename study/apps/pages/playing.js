// Playing: a loaded film is shown once, from its first frame to its last, and the time of every frame is kept.

import { FilmFault } from "./film.js";

const STALL_MS = 2500; // no frame while playing
const WATCH_MS = 100;
const STOPPED_MS = 600; // between two looks of the watch: the page itself stood still, as under a closed lid
const LATE_MS = 60; // what a browser may need to tell of the last frame, or of the end
const GAP_FRAMES = 1.5; // a gap above it flags the trial
const DRIFT_FRAMES = 2; // so does a film that took this much longer, or shorter, than it should

export const hasFrameCallback = "requestVideoFrameCallback" in HTMLVideoElement.prototype;

// The frames that the browser says it presented.
export class Frames {
  constructor(film, fps) {
    Object.assign(this, { film, fps, times: [], indices: [], presented: 0, latest: 0, gap: 0 });
  }

  add(data) {
    const index = Math.round(data.mediaTime * this.fps);
    // An expectation, which a busy machine does not always meet: no frame is seen before the one before it.
    const at = Math.max(data.expectedDisplayTime, this.times.at(-1) ?? 0);
    const counted = data.presentedFrames - this.latest;
    this.latest = data.presentedFrames;
    const before = this.indices.at(-1);
    if (index <= before) {
      // Told of one frame twice, as of the first one, which stood before the film started: no further frame.
      if (this.indices.length === 1) this.times = [at];
      return;
    }
    // A browser may count a frame twice that it draws twice: between two frames there are no more than stand between them
    // in the film. The first frame stood there before the film started, and then is not always presented once more.
    const presented = before === undefined ? Math.min(index + 1, 2) : Math.min(Math.max(1, counted), index - before);
    // The first frame stands while the film starts: no gap is counted before the second.
    if (before > 0) this.gap = Math.max(this.gap, ((at - this.times.at(-1)) * this.fps) / 1000 / presented);
    this.presented += presented;
    this.times.push(at);
    this.indices.push(index);
  }

  get whole() {
    return this.indices.at(-1) >= this.film.frames - 1;
  }

  // By how many frames the film took longer than it should, or shorter; as with gaps, the first one does not count.
  get drift() {
    const lasted = ((this.times.at(-1) - this.times[1]) * this.fps) / 1000;
    return this.times.length > 2 ? Math.abs(lasted - (this.indices.at(-1) - this.indices[1])) : 0;
  }

  // How the film was shown; the last frame's time is the clock that answers run from.
  measured(endedAt) {
    if (!hasFrameCallback) {
      // A film ends when its last frame has stood for its time: nothing else is known of frames here.
      const last = endedAt - 1000 / this.fps;
      return { method: "ended", frames_presented: null, longest_gap_frames: null, shown_well: true, times_ms: [], frames: [], last };
    }
    return {
      method: "requestVideoFrameCallback",
      frames_presented: this.presented,
      longest_gap_frames: Math.round(this.gap * 1000) / 1000,
      shown_well:
        this.whole && this.presented === this.film.frames && this.gap <= GAP_FRAMES && this.drift <= DRIFT_FRAMES,
      times_ms: this.times.map((time) => Math.round(time * 100) / 100),
      frames: this.indices,
      last: this.times.at(-1) ?? endedAt,
    };
  }
}

// Plays a loaded film once; resolves with how it was shown.
export function play(video, film, fps) {
  return new Promise((resolve, reject) => {
    const frames = new Frames(film, fps);
    const controller = new AbortController();
    const { signal } = controller;
    const settle = (action, value) => {
      if (signal.aborted) return;
      controller.abort();
      clearInterval(timer);
      action(value);
    };
    const finish = (at) => settle(resolve, frames.measured(at));
    const fail = (why) => settle(reject, new FilmFault(why));

    const frame = (_, data) => {
      if (signal.aborted) return;
      watch.heard = performance.now();
      frames.add(data);
      if (!frames.whole) video.requestVideoFrameCallback(frame);
      // Not every browser always says that a film has ended: it has, once its last frame has stood for its time.
      else setTimeout(() => finish(performance.now()), Math.max(0, data.expectedDisplayTime - performance.now()) + 1000 / fps + LATE_MS);
    };
    const ended = (event) => setTimeout(() => finish(event.timeStamp), hasFrameCallback && !frames.whole ? LATE_MS : 0);

    const watch = { heard: performance.now(), looked: performance.now(), position: 0 };
    const look = () => {
      const now = performance.now();
      // Time that goes on is a film that goes on; and who could not look can't say that it stood.
      if (video.currentTime > watch.position || now - watch.looked > STOPPED_MS) watch.heard = now;
      Object.assign(watch, { position: video.currentTime, looked: now });
      if (video.currentTime >= video.duration - 0.5 / fps && now - watch.heard > 1000 / fps + LATE_MS) finish(watch.heard);
      else if (now - watch.heard > STALL_MS + 1000 / fps) fail("stalled while playing");
    };
    const timer = setInterval(look, WATCH_MS);
    video.addEventListener("ended", ended, { signal });
    video.addEventListener("error", () => fail(`while playing: ${video.error?.message || "error"}`), { signal });
    if (hasFrameCallback) video.requestVideoFrameCallback(frame);
    video.play().catch((error) => fail(`could not play: ${error.name}`));
  });
}

export const median = (values) => [...values].sort((one, other) => one - other)[Math.floor(values.length / 2)];

// The display's refresh rate, from the time between animation frames; null where it can't be determined.
export function refreshRate(samples = 40) {
  return new Promise((resolve) => {
    const times = [];
    const timer = setTimeout(() => resolve(null), 3000);
    const tick = (now) => {
      times.push(now);
      if (times.length <= samples) {
        requestAnimationFrame(tick);
        return;
      }
      clearTimeout(timer);
      const middle = median(times.slice(1).map((time, i) => time - times[i]));
      resolve(middle > 0 ? Math.round(10000 / middle) / 10 : null);
    };
    requestAnimationFrame(tick);
  });
}
