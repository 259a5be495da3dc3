// Films: loaded whole, proven to decode from the first to the last frame, played once, every frame's time kept.

import { sleep } from "./dom.js";

const LOAD_TRIES = 3;
const STALL_MS = 8000; // no byte, no decoded frame, for so long
const PLAY_STALL_MS = 2500; // no frame while playing
const MOST_KEPT = 6;
export const GAP_FRAMES = 1.5; // a gap above it flags the trial

export class FilmFault extends Error {
  constructor(why) {
    super(why);
    this.why = why;
  }
}

export const hasFrameCallback = "requestVideoFrameCallback" in HTMLVideoElement.prototype;

const blobs = new Map(); // address -> promise of a blob, so that the next trial's films load during this one

async function fetchWhole(url) {
  const controller = new AbortController();
  let timer = 0;
  const restart = () => {
    clearTimeout(timer);
    timer = setTimeout(() => controller.abort(), STALL_MS);
  };
  restart();
  try {
    const response = await fetch(url, { signal: controller.signal, cache: "no-store" });
    if (!response.ok) throw new FilmFault(`status ${response.status}`);
    const expected = Number(response.headers.get("content-length"));
    const parts = [];
    let bytes = 0;
    for (const reader = response.body.getReader(); ; ) {
      restart();
      const { done, value } = await reader.read();
      if (done) break;
      parts.push(value);
      bytes += value.length;
    }
    if (expected && bytes !== expected) throw new FilmFault(`${bytes} of ${expected} bytes`);
    return new Blob(parts, { type: "video/mp4" });
  } catch (error) {
    if (error instanceof FilmFault) throw error;
    throw new FilmFault(controller.signal.aborted ? "stalled while loading" : "connection lost");
  } finally {
    clearTimeout(timer);
  }
}

function blobOf(url) {
  if (!blobs.has(url)) {
    const promise = fetchWhole(url);
    promise.catch(() => blobs.delete(url));
    blobs.set(url, promise);
    while (blobs.size > MOST_KEPT) blobs.delete(blobs.keys().next().value);
  }
  return blobs.get(url);
}

export function forget(films) {
  for (const film of films) blobs.delete(film.url);
}

export function loadAhead(films) {
  for (const film of films ?? []) blobOf(film.url).catch(() => {});
}

function once(target, good, milliseconds, what) {
  return new Promise((resolve, reject) => {
    const timer = setTimeout(() => settle(reject, new FilmFault(`${what}: no answer`)), milliseconds);
    const ok = () => settle(resolve);
    const bad = () => settle(reject, new FilmFault(`${what}: ${target.error?.message || "error"}`));
    const settle = (action, value) => {
      clearTimeout(timer);
      target.removeEventListener(good, ok);
      target.removeEventListener("error", bad);
      action(value);
    };
    target.addEventListener(good, ok);
    target.addEventListener("error", bad);
  });
}

async function seek(video, seconds) {
  const there = once(video, "seeked", STALL_MS, `frame at ${seconds.toFixed(2)} s`);
  video.currentTime = seconds;
  await there;
  if (video.readyState < HTMLMediaElement.HAVE_CURRENT_DATA) throw new FilmFault(`no frame at ${seconds.toFixed(2)} s`);
}

async function prove(film, fps, blob) {
  // Browsers may find a last frame in half a file, and fail only while playing: the file has to be whole, too.
  if (blob.size !== film.bytes) throw new FilmFault(`${blob.size} of ${film.bytes} bytes`);
  const video = document.createElement("video");
  Object.assign(video, { muted: true, playsInline: true, preload: "auto", disablePictureInPicture: true });
  video.setAttribute("muted", "");
  video.setAttribute("playsinline", "");
  video.setAttribute("aria-hidden", "true");
  video.tabIndex = -1;
  const ready = once(video, "loadeddata", STALL_MS, "first frame");
  video.src = URL.createObjectURL(blob);
  try {
    await ready;
    const seconds = film.frames / fps;
    if (Math.abs(video.duration - seconds) > 1.5 / fps) {
      throw new FilmFault(`${video.duration.toFixed(3)} s long instead of ${seconds.toFixed(3)} s`);
    }
    await seek(video, (film.frames - 0.5) / fps);
    await seek(video, 0);
    return video;
  } catch (error) {
    release(video);
    throw error;
  }
}

export function release(video) {
  URL.revokeObjectURL(video.src);
  video.removeAttribute("src");
  video.load();
  video.remove();
}

// A film, proven to decode; tried again where something goes wrong, then a FilmFault.
export async function load(film, fps, onFault = () => {}) {
  for (let attempt = 1; ; attempt += 1) {
    try {
      return await prove(film, fps, await blobOf(film.url));
    } catch (error) {
      const fault = error instanceof FilmFault ? error : new FilmFault(String(error));
      blobs.delete(film.url);
      onFault(fault.why, attempt);
      if (attempt >= LOAD_TRIES) throw fault;
      await sleep(400 * attempt);
    }
  }
}

// Plays a loaded film once. Resolves with how it was shown; the last frame's time is the clock that answers run from.
export function play(video, film, fps) {
  return new Promise((resolve, reject) => {
    const times = [];
    const frames = [];
    let counted = null; // presentedFrames at the first and at the latest callback
    let gap = 0;
    let heard = performance.now();
    let position = 0;
    let over = false;
    const frame = (now, data) => {
      if (over) return;
      heard = performance.now();
      const at = data.expectedDisplayTime;
      const index = Math.round(data.mediaTime * fps);
      // The first frame stands while the film starts: no gap is counted before the second.
      if (times.length > 0 && frames[frames.length - 1] > 0) {
        const presented = Math.max(1, data.presentedFrames - counted.last);
        gap = Math.max(gap, ((at - times[times.length - 1]) * fps) / 1000 / presented);
      }
      counted = { first: counted?.first ?? data.presentedFrames, last: data.presentedFrames };
      times.push(at);
      frames.push(index);
      video.requestVideoFrameCallback(frame);
    };
    const finish = (action, value) => {
      over = true;
      clearInterval(watch);
      video.removeEventListener("ended", ended);
      video.removeEventListener("error", failed);
      action(value);
    };
    const failed = () => finish(reject, new FilmFault(`while playing: ${video.error?.message || "error"}`));
    const ended = (event) => {
      // The last frame's callback may come just after the end.
      const wait = hasFrameCallback && frames[frames.length - 1] !== film.frames - 1 ? 60 : 0;
      setTimeout(() => finish(resolve, measured(event.timeStamp)), wait);
    };
    const measured = (endedAt) => {
      if (!hasFrameCallback) {
        return { method: "ended", frames_presented: null, longest_gap_frames: null, shown_well: true, times_ms: [], frames: [], last: endedAt };
      }
      // The first frame stood there before the film started, and then is not presented once more.
      const stood = frames.length > 0 && frames[0] > 0 ? 1 : 0;
      const presented = counted ? counted.last - counted.first + 1 + stood : stood;
      const whole = frames[frames.length - 1] >= film.frames - 1 && presented >= film.frames;
      return {
        method: "requestVideoFrameCallback",
        frames_presented: presented,
        longest_gap_frames: Math.round(gap * 1000) / 1000,
        shown_well: whole && gap <= GAP_FRAMES,
        times_ms: times.map((time) => Math.round(time * 1000) / 1000),
        frames,
        last: times[times.length - 1] ?? endedAt,
      };
    };
    const watch = setInterval(() => {
      // Time that goes on is a film that goes on, whether or not the browser tells of frames.
      if (video.currentTime > position) heard = performance.now();
      position = video.currentTime;
      if (performance.now() - heard > PLAY_STALL_MS + 1000 / fps) finish(reject, new FilmFault("stalled while playing"));
    }, 100);
    video.addEventListener("ended", ended);
    video.addEventListener("error", failed);
    if (hasFrameCallback) video.requestVideoFrameCallback(frame);
    video.play().catch((error) => finish(reject, new FilmFault(`could not play: ${error.name}`)));
  });
}

// The display's refresh rate, from the time between animation frames; null where it can't be told.
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
      const steps = times.slice(1).map((time, i) => time - times[i]).sort((a, b) => a - b);
      const middle = steps[Math.floor(steps.length / 2)];
      resolve(middle > 0 ? Math.round(10000 / middle) / 10 : null);
    };
    requestAnimationFrame(tick);
  });
}
