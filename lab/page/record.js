// The record of the last samples, in a memory of constant size.

// Rows that are kept, for the pictures and for CSV: five minutes of the default scene, 16 MB.
const MOST_ROWS = 1 << 18;

export class Record {
  length = 0;
  #first = 0;

  constructor(columns) {
    this.columns = columns;
    this.values = new Float64Array(MOST_ROWS * columns);
  }

  clear() { this.length = this.#first = 0; }

  // Appends rows, one after the other in `values`; the oldest make room.
  push(values) {
    for (let i = 0; i < values.length; i += this.columns) {
      this.values.set(values.subarray(i, i + this.columns), ((this.#first + this.length) % MOST_ROWS) * this.columns);
      if (this.length < MOST_ROWS) this.length++;
      else this.#first = (this.#first + 1) % MOST_ROWS;
    }
  }

  // Row i, or counted from the end if i is negative; valid until it makes room.
  row(i) {
    const at = ((this.#first + (i < 0 ? this.length + i : i)) % MOST_ROWS) * this.columns;
    return this.values.subarray(at, at + this.columns);
  }

  // The last row that is not later than `time`, s, or the first one.
  at(time) {
    let [low, high] = [0, this.length - 1];
    while (low < high) {
      const middle = Math.ceil((low + high) / 2);
      if (this.row(middle)[0] <= time) low = middle;
      else high = middle - 1;
    }
    return low;
  }
}
