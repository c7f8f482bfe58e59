// Numbers as the bench reads them. A value that is not known is a dash.

const DASH = "–";
const grouped = new Intl.NumberFormat("en-US", { maximumFractionDigits: 0 });

export const known = (value) => value !== null && value !== undefined;
export const whole = (value) => (known(value) ? grouped.format(value) : DASH);
export const decimals = (value, digits) => (known(value) ? value.toFixed(digits) : DASH);

// Amplitudes: a tenth of a µm below ten, whole µm from there.
export const micrometres = (value) => (known(value) ? value.toFixed(Math.abs(value) < 9.95 ? 1 : 0) : DASH);
// A standard deviation: one digit that counts.
export const sigma = (value) => (!known(value) ? DASH : value < 0.001 ? "<0.001" : String(Number(value.toPrecision(1))));
export const lag = (value) => (known(value) ? `${Math.round(value) % 360}°` : "");
export const order = (value) => (known(value) ? `${value.toFixed(2)}X` : DASH);

export function clock(seconds) {
  if (!known(seconds)) return DASH;
  const total = Math.floor(seconds);
  const pad = (number) => String(number).padStart(2, "0");
  const [hours, minutes, rest] = [Math.floor(total / 3600), Math.floor(total / 60) % 60, total % 60];
  return hours ? `${hours}:${pad(minutes)}:${pad(rest)}` : `${pad(minutes)}:${pad(rest)}`;
}

export function span(seconds) {
  if (!known(seconds)) return DASH;
  if (seconds < 120) return `${seconds.toFixed(seconds < 10 ? 1 : 0)} s`;
  if (seconds < 7200) return `${Math.floor(seconds / 60)} min`;
  return seconds < 172800 ? `${Math.floor(seconds / 3600)} h` : `${Math.floor(seconds / 86400)} d`;
}

export function count(samples) {
  if (!known(samples)) return DASH;
  if (samples < 1e5) return grouped.format(samples);
  return samples < 1e9 ? `${(samples / 1e6).toFixed(samples < 1e7 ? 2 : 1)} M` : `${(samples / 1e9).toFixed(2)} G`;
}

export function moment(text) {
  return new Date(text).toLocaleString("en-GB", { dateStyle: "medium", timeStyle: "short" });
}
