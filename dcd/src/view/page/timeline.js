// Draws the costs of the last ticks as rows of bars: step times, changes of owner, exchanges and bytes.

const KEPT = 1200;

export class Timeline {
  constructor(canvas) {
    this.canvas = canvas;
    this.samples = [];
    this.changed = true;
  }

  add(samples) {
    for (const sample of samples) {
      // A client's page is shown several pictures between two ticks: the numbers of all of them count.
      const same = this.last();
      if (same?.tick === sample.tick) {
        sample.transfers += same.transfers;
        sample.bytes += same.bytes;
      }
      // A recording may go back.
      while (this.last()?.tick >= sample.tick) this.samples.pop();
      this.samples.push(sample);
    }
    if (this.samples.length > 2 * KEPT) this.samples.splice(0, this.samples.length - KEPT);
    this.changed = true;
  }

  last() {
    return this.samples[this.samples.length - 1];
  }

  draw(colours, dt) {
    if (!this.changed) return;
    this.changed = false;
    const scale = Math.min(2, devicePixelRatio || 1), { clientWidth: w, clientHeight: h } = this.canvas;
    if (!w) return;
    this.canvas.width = w * scale;
    this.canvas.height = h * scale;
    const to = this.canvas.getContext("2d");
    to.scale(scale, scale);
    to.font = "11px system-ui, sans-serif";
    const all = this.samples.slice(-Math.min(KEPT, Math.floor(w)));
    if (!all.length) return;
    const x = (i) => w - all.length + i;
    const most = (name) => all.reduce((top, sample) => Math.max(top, sample[name]), 0);
    const rows = [
      ["ms", "step", most("ms"), (v) => `${v.toFixed(1)} ms`, colours.bar],
      ["transfers", "handed over", most("transfers"), (v) => String(v), colours.mark],
      ["exchanges", "exchanges", most("exchanges"), (v) => String(v), colours.line],
      ["bytes", "bytes", most("bytes"), (v) => v > 9999 ? `${(v / 1000).toFixed(0)} kB` : String(v), colours.line],
    ].filter(([, , top]) => top > 0);
    const high = h / Math.max(1, rows.length);
    rows.forEach(([name, label, top, words, colour], row) => {
      // A rare peak is cut off, so that the rest is seen.
      const usual = all.map((sample) => sample[name]).sort((a, b) => a - b)[Math.floor(0.98 * all.length)];
      const full = usual > 0 ? Math.min(top, 1.6 * usual) : top;
      const base = (row + 1) * high - 1, scaled = (v) => Math.min(1, v / full) * (high - 3);
      to.fillStyle = colour;
      all.forEach((sample, i) => {
        const v = scaled(sample[name]);
        if (v > 0) to.fillRect(x(i), base - v, 1, v);
      });
      if (name === "ms" && dt * 1e3 < full) {
        to.fillStyle = colours.soft;
        to.fillRect(0, base - scaled(dt * 1e3), w, 0.5);
      }
      const text = `${label} ${words(all[all.length - 1][name])}, at most ${words(top)}`;
      const wide = to.measureText(text).width;
      to.fillStyle = colours.back;
      to.fillRect(0, base - 12, wide + 6, 12);
      to.fillStyle = colours.soft;
      to.fillText(text, 0, base - 2);
    });
  }
}
