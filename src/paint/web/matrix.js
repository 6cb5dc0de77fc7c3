// The light transport matrix of a page that needs no server: sparse layers, unpacked from bytes, and products with them.

/** Reads variable-length numbers: seven bits a byte, the least first. */
class Numbers {
  constructor(bytes) {
    this.bytes = bytes;
    this.at = 0;
  }

  next() {
    let [value, shift, byte] = [0, 0, 0];
    do {
      byte = this.bytes[this.at];
      this.at += 1;
      value |= (byte & 127) << shift;
      shift += 7;
    } while (byte > 127);
    return value >>> 0;
  }
}

/** The values of half-precision numbers by their bits. */
function halfTable() {
  const table = new Float32Array(65536);
  for (let bits = 0; bits < 65536; bits += 1) {
    const [exponent, fraction] = [(bits >> 10) & 31, bits & 1023];
    const size = exponent === 0 ? fraction * 2 ** -24 : (1 + fraction / 1024) * 2 ** (exponent - 15);
    table[bits] = bits & 32768 ? -size : size;
  }
  return table;
}

/** The values of a packed layer, times its scale. */
function unpackValues(bytes, precision, scale) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (precision === "single") {
    return Float32Array.from({ length: bytes.length / 4 }, (_, index) => view.getFloat32(4 * index, true) * scale);
  }
  const table = halfTable();
  return Float32Array.from({ length: bytes.length / 2 }, (_, index) => table[view.getUint16(2 * index, true)] * scale);
}

/**
 * A sparse matrix by its columns: the light of each projector pixel. `layer` has `rows`, `columns`, `symmetric` (then only entries
 * with row ≥ column were packed), `precision` and `scales`; `positions` and `values` are its bytes.
 */
export class Layer {
  constructor(layer, positions, values) {
    this.rows = layer.rows;
    this.columns = layer.columns;
    const packed = unpackPositions(layer, positions);
    const planes = values.map((bytes, channel) => unpackValues(bytes, layer.precision, layer.scales[channel]));
    Object.assign(this, layer.symmetric ? mirrored(packed, planes, layer.columns) : { ...packed, values: planes });
  }

  /** Adds `change` times the column to a photo's plane. */
  addColumn(channel, column, change, photo) {
    const [values, { places, starts }] = [this.values[channel], this];
    for (let at = starts[column]; at < starts[column + 1]; at += 1) photo[places[at]] += change * values[at];
  }

  /** The dot product of a column with a plane of the camera's pixels. */
  dotColumn(channel, column, plane) {
    const [values, { places, starts }] = [this.values[channel], this];
    let sum = 0;
    for (let at = starts[column]; at < starts[column + 1]; at += 1) sum += values[at] * plane[places[at]];
    return sum;
  }
}

function unpackPositions({ columns }, bytes) {
  const numbers = new Numbers(bytes);
  const starts = new Uint32Array(columns + 1);
  for (let column = 0; column < columns; column += 1) starts[column + 1] = starts[column] + numbers.next();
  const places = new Uint32Array(starts[columns]);
  for (let column = 0; column < columns; column += 1) {
    let place = 0;
    for (let at = starts[column]; at < starts[column + 1]; at += 1) {
      place += numbers.next();
      places[at] = place;
    }
  }
  return { starts, places };
}

/** Both halves of a symmetric matrix from the one that has row ≥ column. */
function mirrored({ starts, places }, planes, columns) {
  const counts = new Uint32Array(columns + 1);
  for (let column = 0; column < columns; column += 1) {
    for (let at = starts[column]; at < starts[column + 1]; at += 1) {
      counts[column + 1] += 1;
      if (places[at] !== column) counts[places[at] + 1] += 1;
    }
  }
  for (let column = 0; column < columns; column += 1) counts[column + 1] += counts[column];
  const next = counts.slice();
  const whole = new Uint32Array(counts[columns]);
  const values = planes.map(() => new Float32Array(counts[columns]));
  const put = (column, place, at) => {
    whole[next[column]] = place;
    planes.forEach((plane, channel) => (values[channel][next[column]] = plane[at]));
    next[column] += 1;
  };
  for (let column = 0; column < columns; column += 1) {
    for (let at = starts[column]; at < starts[column + 1]; at += 1) {
      put(column, places[at], at);
      if (places[at] !== column) put(places[at], column, at);
    }
  }
  return { starts: counts, places: whole, values };
}

/** The sum of several layers. */
export class Matrix {
  constructor(layers, channels) {
    this.layers = layers;
    this.channels = channels;
    [this.rows, this.columns] = [layers[0].rows, layers[0].columns];
  }

  /** The photo of a pattern, a plane of 64-bit sums for each channel. */
  multiply(pattern) {
    return pattern.map((plane, channel) => this.multiplyPlane(channel, plane));
  }

  /** The photo of one plane of a pattern. */
  multiplyPlane(channel, plane) {
    const photo = new Float64Array(this.rows);
    for (let column = 0; column < this.columns; column += 1) {
      if (plane[column] !== 0) this.addColumn(channel, column, plane[column], photo);
    }
    return photo;
  }

  /** The transposed product. */
  multiplyTransposed(planes) {
    return planes.map((plane, channel) => this.transposePlane(channel, plane));
  }

  /** The transposed product of one plane of a photo. */
  transposePlane(channel, plane) {
    const found = new Float64Array(this.columns);
    for (let column = 0; column < this.columns; column += 1) {
      for (const layer of this.layers) found[column] += layer.dotColumn(channel, column, plane);
    }
    return found;
  }

  addColumn(channel, column, change, photo) {
    for (const layer of this.layers) layer.addColumn(channel, column, change, photo);
  }

  /** The light of one projector pixel. */
  column(pixel) {
    const photo = this.planes(this.rows);
    photo.forEach((plane, channel) => this.addColumn(channel, pixel, 1, plane));
    return photo;
  }

  /** Which projector pixels light one camera pixel: a row of the matrix. */
  row(pixel) {
    const seen = this.planes(this.rows);
    seen.forEach((plane) => (plane[pixel] = 1));
    return this.multiplyTransposed(seen);
  }

  planes(length) {
    return Array.from({ length: this.channels }, () => new Float64Array(length));
  }
}
