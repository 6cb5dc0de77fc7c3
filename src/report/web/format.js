// Numbers as text.

/** A number with so many digits, and true minus signs. */
export function formatDigits(value, digits) {
  if (!Number.isFinite(value)) return String(value);
  if (value === 0) return "0";
  const size = Math.abs(value);
  const text = size >= 1e5 || size < 1e-3 ? value.toExponential(digits - 1) : String(Number(value.toPrecision(digits)));
  return text.replaceAll("-", "\u2212").replace("e+", "e");
}

/** A number with about four digits. */
export function formatNumber(value) {
  return formatDigits(value, 4);
}

/** The values of one pixel with their unit: one number, or red, green and blue. */
export function formatPixel(values, unit, digits = 4) {
  const numbers = Array.from(values, (value) => formatDigits(value, digits));
  return (numbers.length > 1 ? `(${numbers.join(", ")})` : numbers[0]) + (unit ? ` ${unit}` : "");
}
