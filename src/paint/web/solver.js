// Which pattern within bounds makes the photo that is wanted: min ‖W(A x − b)‖ over lower ≤ x ≤ upper, by FISTA with restarts.

const dot = (a, b) => a.reduce((sum, value, index) => sum + value * b[index], 0);

/** The largest eigenvalue of AᵀW²A, by a few steps of the power method, with a margin. */
function lipschitz(matrix, channel, weighted) {
  let vector = new Float64Array(matrix.columns).fill(1 / Math.sqrt(matrix.columns));
  let value = 0;
  for (let step = 0; step < 8; step += 1) {
    const next = matrix.transposePlane(channel, weighted(matrix.multiplyPlane(channel, vector)));
    value = Math.sqrt(dot(next, next));
    if (value === 0) return 1;
    vector = next.map((entry) => entry / value);
  }
  return 1.1 * value;
}

/**
 * Solves for one channel. `target` and `weights` have the camera's pixels; `report` is called with each iterate and its relative
 * residual, and stops the solver by returning `false`.
 */
export function solveBox(matrix, channel, { target, weights, bounds, iterations }, report) {
  const [lower, upper] = bounds;
  const weighted = (plane) => plane.map((value, pixel) => value * weights[pixel] * weights[pixel]);
  const size = Math.sqrt(target.reduce((sum, value, pixel) => sum + (value * weights[pixel]) ** 2, 0)) || 1;
  const step = 1 / lipschitz(matrix, channel, weighted);
  // Light that no pixel asks for stays off.
  let x = new Float64Array(matrix.columns).fill(lower);
  let [y, momentum] = [x, 1];
  for (let iteration = 0; iteration < iterations; iteration += 1) {
    const off = matrix.multiplyPlane(channel, y).map((value, pixel) => value - target[pixel]);
    const residual = Math.sqrt(off.reduce((sum, value, pixel) => sum + (value * weights[pixel]) ** 2, 0)) / size;
    if (report(x, residual, iteration) === false) break;
    const gradient = matrix.transposePlane(channel, weighted(off));
    const next = y.map((value, index) => Math.min(upper, Math.max(lower, value - step * gradient[index])));
    // Momentum that points uphill is dropped.
    const uphill = next.reduce((sum, value, index) => sum + (y[index] - value) * (value - x[index]), 0) > 0;
    const grown = uphill ? 1 : 0.5 * (1 + Math.sqrt(1 + 4 * momentum * momentum));
    const share = uphill ? 0 : (momentum - 1) / grown;
    y = next.map((value, index) => value + share * (value - x[index]));
    [x, momentum] = [next, grown];
  }
  return x;
}
