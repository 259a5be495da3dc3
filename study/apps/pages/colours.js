// Colours of all pages, from the films' background: the page has it everywhere, so that nothing flashes where a film
// begins or ends, and text has the contrast that WCAG asks for (section 1.4.3: 4.5 to 1) on whatever it is.

const INKS = [[22, 27, 40], [255, 255, 255], [0, 0, 0]];
const WARNINGS = [[138, 46, 10], [255, 190, 150]];
const LEGIBLE = 4.5;
const VISIBLE = 3; // of borders: section 1.4.11

const linear = (value) => (value <= 0.04045 * 255 ? value / 255 / 12.92 : ((value / 255 + 0.055) / 1.055) ** 2.4);
const luminance = ([red, green, blue]) => 0.2126 * linear(red) + 0.7152 * linear(green) + 0.0722 * linear(blue);

export function contrast(one, other) {
  const [low, high] = [luminance(one), luminance(other)].sort((a, b) => a - b);
  return (high + 0.05) / (low + 0.05);
}

const mix = (from, to, share) => from.map((value, i) => Math.round(value + share * (to[i] - value)));
const css = (colour) => `rgb(${colour.join(", ")})`;
const legible = (colours, ground, least = LEGIBLE) => colours.find((colour) => contrast(colour, ground) >= least);
const towards = (ground, ink, shares) => shares.map((share) => mix(ground, ink, share));

export function palette(ground) {
  const best = legible(INKS, ground); // black or white is, on every colour
  // As soft as stays legible.
  const soft = legible(towards(ground, best, [0.7, 0.8, 0.9]), ground) ?? best;
  const line = legible(towards(ground, best, [0.5, 0.6, 0.7, 0.8, 0.9]), ground, VISIBLE) ?? best;
  const dark = luminance(best) > luminance(ground);
  const raised = dark ? mix(ground, [255, 255, 255], 0.1) : mix(ground, [255, 255, 255], 0.7);
  return { stage: ground, ink: best, soft, raised: contrast(best, raised) >= LEGIBLE ? raised : ground, warn: legible(WARNINGS, ground) ?? best, line };
}

export function surround(ground) {
  // What browsers draw by themselves, such as lists to choose from, follows.
  document.documentElement.style.colorScheme = contrast(ground, [255, 255, 255]) > contrast(ground, [0, 0, 0]) ? "dark" : "light";
  for (const [name, colour] of Object.entries(palette(ground))) document.documentElement.style.setProperty(`--${name}`, css(colour));
}

export const fromHex = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
