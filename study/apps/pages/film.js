// Films: loaded whole, tried again where that fails, and proven to decode from the first to the last frame.

import { sleep } from "./dom.js";

const LOAD_TRIES = 3;
const STALL_MS = 8000; // no byte, no decoded frame, for so long
const MOST_KEPT = 6;

export class FilmFault extends Error {
  constructor(why) {
    super(why);
    this.why = why;
  }
}

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

export async function seek(video, seconds) {
  const there = once(video, "seeked", STALL_MS, `frame at ${seconds.toFixed(2)} s`);
  video.currentTime = seconds;
  await there;
  if (video.readyState < HTMLMediaElement.HAVE_CURRENT_DATA) throw new FilmFault(`no frame at ${seconds.toFixed(2)} s`);
}

async function prove(film, fps, blob) {
  // Browsers may find a last frame in half a file, and fail only while playing: the file has to be whole, too.
  if (!blob.size || blob.size % film.bytes) throw new FilmFault(`${blob.size} of ${film.bytes} bytes`);
  // All films are sent at one size, or a multiple of it; what distinguishes them is at the end.
  film.frames = new DataView(await blob.slice(-4).arrayBuffer()).getUint32(0);
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
