// Formats numbers for display; an unknown value is a dash.

const DASH = "–";
const grouped = new Intl.NumberFormat("en-US", { maximumFractionDigits: 0 });

export const isKnown = (value) => value !== null && value !== undefined;
export const formatInteger = (value) => (isKnown(value) ? grouped.format(value) : DASH);
export const formatFixed = (value, digits) => (isKnown(value) ? value.toFixed(digits) : DASH);

// Amplitudes: one decimal below 10 µm, none above.
export const formatMicrometres = (value) => (isKnown(value) ? value.toFixed(Math.abs(value) < 9.95 ? 1 : 0) : DASH);
// Standard deviations: one significant digit.
export const formatSigma = (value) => (!isKnown(value) ? DASH : value < 0.001 ? "<0.001" : String(Number(value.toPrecision(1))));
export const formatLag = (value) => (isKnown(value) ? `${Math.round(value) % 360}°` : "");
export const formatOrder = (value) => (isKnown(value) ? `${value.toFixed(2)}X` : DASH);

export function formatClock(seconds) {
  if (!isKnown(seconds)) return DASH;
  const total = Math.floor(seconds);
  const pad = (number) => String(number).padStart(2, "0");
  const [hours, minutes, rest] = [Math.floor(total / 3600), Math.floor(total / 60) % 60, total % 60];
  return hours ? `${hours}:${pad(minutes)}:${pad(rest)}` : `${pad(minutes)}:${pad(rest)}`;
}

export function formatDuration(seconds) {
  if (!isKnown(seconds)) return DASH;
  if (seconds < 120) return `${seconds.toFixed(seconds < 10 ? 1 : 0)} s`;
  if (seconds < 7200) return `${Math.floor(seconds / 60)} min`;
  return seconds < 172800 ? `${Math.floor(seconds / 3600)} h` : `${Math.floor(seconds / 86400)} d`;
}

export function formatCount(samples) {
  if (!isKnown(samples)) return DASH;
  if (samples < 1e5) return grouped.format(samples);
  return samples < 1e9 ? `${(samples / 1e6).toFixed(samples < 1e7 ? 2 : 1)} M` : `${(samples / 1e9).toFixed(2)} G`;
}

export function formatDate(text) {
  return new Date(text).toLocaleString("en-GB", { dateStyle: "medium", timeStyle: "short" });
}
