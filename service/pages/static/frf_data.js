"use strict";
/* FRFs in the browser: read from npz, turned into what is drawn, and what is read off a curve. No
   drawing and no page here. */
const FrfData = (() => {
  /* Members of an npz that is not compressed, as REST writes it: found by the zip's directory,
     whose sizes are right. */
  function arraysOf(buffer) {
    const view = new DataView(buffer);
    const text = (at, length) =>
      new TextDecoder("latin1").decode(new Uint8Array(buffer, at, length));
    let end = buffer.byteLength - 22;
    while (end >= 0 && view.getUint32(end, true) !== 0x06054b50) end -= 1;
    if (end < 0) throw new Error("the answer is no npz");
    const arrays = {};
    for (
      let k = view.getUint16(end + 10, true), at = view.getUint32(end + 16, true);
      k > 0;
      k -= 1
    ) {
      const [nameLength, extra, comment, local] = [
        view.getUint16(at + 28, true),
        view.getUint16(at + 30, true),
        view.getUint16(at + 32, true),
        view.getUint32(at + 42, true),
      ];
      const name = text(at + 46, nameLength).replace(/\.npy$/, "");
      arrays[name] = arrayAt(
        buffer,
        view,
        local + 30 + view.getUint16(local + 26, true) + view.getUint16(local + 28, true),
        text,
      );
      at += 46 + nameLength + extra + comment;
    }
    return arrays;
  }
  const KINDS = { "<f8": [Float64Array, 1], "<c8": [Float32Array, 2], "<c16": [Float64Array, 2] };
  /* Real values, or real and imaginary parts in turn; null of a kind that nobody draws, such as
     texts. */
  function arrayAt(buffer, view, at, text) {
    const wide = view.getUint8(at + 6) > 1;
    const length = wide ? view.getUint32(at + 8, true) : view.getUint16(at + 8, true);
    const begin = at + (wide ? 12 : 10);
    const header = text(begin, length);
    const kind = KINDS[/'descr': '([^']+)'/.exec(header)?.[1]];
    if (!kind) return null;
    const count = /'shape': \(([^)]*)\)/
      .exec(header)[1]
      .split(",")
      .filter((n) => n.trim())
      .reduce((all, n) => all * Number(n), kind[1]);
    return new kind[0](
      buffer.slice(begin + length, begin + length + count * kind[0].BYTES_PER_ELEMENT),
    );
  }

  const ORDER = { accelerance: 0, mobility: 1, receptance: 2 };
  const UNIT = { accelerance: "m/s²/N", mobility: "m/s/N", receptance: "m/N" };
  /* An FRF in another quantity: divided by iω once for each integration. */
  function converted(curve, quantity) {
    const turns = ORDER[quantity] - ORDER[curve.quantity];
    const [re, im] = [curve.re.slice(), curve.im.slice()];
    if (!turns) return { re, im };
    for (let i = 0; i < re.length; i += 1) {
      const w = 2 * Math.PI * curve.hz[i];
      for (let k = 0; k < Math.abs(turns); k += 1) {
        const [a, b] = [re[i], im[i]];
        [re[i], im[i]] = turns > 0 ? [b / w, -a / w] : [-b * w, a * w];
      }
      if (!Number.isFinite(re[i])) re[i] = im[i] = NaN;
    }
    return { re, im };
  }
  const DEGREES = 180 / Math.PI;
  const PARTS = {
    log: (re, im) => Math.log10(Math.hypot(re, im)),
    db: (re, im) => 20 * Math.log10(Math.hypot(re, im)),
    phase: (re, im) => DEGREES * Math.atan2(im, re),
    real: (re) => re,
    imag: (_, im) => im,
  };
  const part = (pair, name) =>
    Float64Array.from(pair.re, (re, i) => {
      const v = PARTS[name](re, pair.im[i]);
      return Number.isFinite(v) ? v : NaN;
    });

  /* Place of the line that is nearest to a frequency. */
  function nearest(hz, f) {
    let [a, b] = [0, hz.length - 1];
    while (b - a > 1) {
      const m = (a + b) >> 1;
      if (hz[m] <= f) a = m;
      else b = m;
    }
    return Math.abs(hz[b] - f) < Math.abs(f - hz[a]) ? b : a;
  }
  const AROUND = 40; // lines on each side, of which the noise is known
  const median = (values) => values.sort((a, b) => a - b)[values.length >> 1];
  /* Standard deviation of ln |H| from line to line, that of a normal distribution with the same
     median of second differences, which no peak moves; and the middle of |H| there. */
  function noiseAt(size, i) {
    const [levels, bends] = [[], []];
    const last = Math.min(size.length - 2, i + AROUND);
    for (let k = Math.max(1, i - AROUND); k <= last; k += 1) {
      levels.push(size[k]);
      bends.push(Math.abs(Math.log((size[k - 1] * size[k + 1]) / size[k] ** 2)));
    }
    return { sd: (1.4826 * median(bends)) / Math.sqrt(6), level: median(levels) };
  }
  /* The next local maximum in a direction (±1) whose prominence is a tenth of it and 5 standard
     deviations of a difference, and which lies 4 above its neighbourhood, as the deep gaps of mere
     noise make others prominent; null where there is none. */
  function nextPeak(size, from, step) {
    for (let i = from + step; i > 0 && i < size.length - 1; i += step) {
      if (!(size[i] >= size[i - 1] && size[i] > size[i + 1])) continue;
      const floor = (way) => {
        let low = size[i];
        for (let k = i + way; k >= 0 && k < size.length && size[k] <= size[i]; k += way)
          low = Math.min(low, size[k]);
        return low;
      };
      const prominence = Math.log(size[i] / Math.max(floor(-1), floor(1)));
      if (!(prominence > 0.1)) continue;
      const { sd, level } = noiseAt(size, i);
      if (prominence > 5 * Math.SQRT2 * sd && Math.log(size[i] / level) > 4 * sd) return i;
    }
    return null;
  }
  /* Damping ratio of the peak at a line by its half-power bandwidth, ζ = (f₂ − f₁) / 2f₀ (Ewins
     2000, 4.2); null where the curve rises again before it has fallen by √2 on both sides. */
  function halfPower(hz, size, at) {
    let top = at;
    while (top > 0 && size[top - 1] > size[top]) top -= 1;
    while (top < size.length - 1 && size[top + 1] > size[top]) top += 1;
    const level = size[top] / Math.SQRT2;
    const edge = (way) => {
      for (let i = top + way; i >= 0 && i < size.length; i += way) {
        if (!(size[i] <= size[i - way])) return null;
        if (size[i] <= level)
          return hz[i] + ((level - size[i]) / (size[i - way] - size[i])) * (hz[i - way] - hz[i]);
      }
      return null;
    };
    const [low, high] = [edge(-1), edge(1)];
    return low === null || high === null
      ? null
      : { hz: hz[top], ratio: (high - low) / (2 * hz[top]), lines: (high - low) / (hz[1] - hz[0]) };
  }
  /* Random error of a magnitude as a share of it, √((1 − γ²) / 2nγ²) (Bendat and Piersol 2010,
     table 9.6); null where unknown. */
  const randomError = (coherence, averages) =>
    coherence && averages
      ? Math.sqrt(Math.max(0, 1 - coherence) / (2 * averages * coherence))
      : null;

  /* Singular values of H(ω), response points by references (complex mode indicator function, Shih
     1988): the eigenvalues of the smaller of its products with its transpose. `table` is references
     of responses of curves on one axis. */
  function cmif(curves) {
    const refs = [...new Set(curves.map((c) => c.reference))];
    const responses = [...new Set(curves.map((c) => c.response))];
    const [few, many, of] =
      refs.length <= responses.length
        ? [refs, responses, (c) => [c.reference, c.response]]
        : [responses, refs, (c) => [c.response, c.reference]];
    const n = Math.min(few.length, 6);
    const table = few
      .slice(0, n)
      .map((f) => many.map((m) => curves.find((c) => of(c)[0] === f && of(c)[1] === m)));
    const lines = curves[0].hz.length;
    const values = Array.from({ length: n }, () => new Float64Array(lines));
    for (let line = 0; line < lines; line += 1) {
      const gram = Array.from({ length: 2 * n }, () => new Float64Array(2 * n));
      for (let i = 0; i < n; i += 1)
        for (let j = 0; j < n; j += 1) {
          let [re, im] = [0, 0];
          for (let k = 0; k < many.length; k += 1) {
            const [p, q] = [table[i][k], table[j][k]];
            if (!p || !q) continue;
            re += p.re[line] * q.re[line] + p.im[line] * q.im[line];
            im += p.im[line] * q.re[line] - p.re[line] * q.im[line];
          }
          gram[i][j] = gram[n + i][n + j] = re;
          gram[n + i][j] = im;
          gram[i][n + j] = -im;
        }
      eigenvalues(gram)
        .sort((a, b) => b - a)
        .forEach((v, k) => {
          if (k % 2 === 0) values[k / 2][line] = Math.sqrt(Math.max(0, v));
        });
    }
    return values;
  }
  /* Of a real symmetric matrix, by Jacobi's rotations. */
  function eigenvalues(a) {
    const n = a.length;
    for (let sweep = 0; sweep < 12; sweep += 1) {
      let [off, all] = [0, 0];
      for (let p = 0; p < n; p += 1)
        for (let q = 0; q < n; q += 1) {
          all += a[p][q] ** 2;
          if (p !== q) off += a[p][q] ** 2;
        }
      if (off <= 1e-20 * all) break;
      for (let p = 0; p < n - 1; p += 1)
        for (let q = p + 1; q < n; q += 1) {
          if (!a[p][q]) continue;
          const theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
          const t = (theta >= 0 ? 1 : -1) / (Math.abs(theta) + Math.hypot(theta, 1));
          const [c, s] = [1 / Math.hypot(t, 1), t / Math.hypot(t, 1)];
          for (let k = 0; k < n; k += 1)
            [a[k][p], a[k][q]] = [c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]];
          for (let k = 0; k < n; k += 1)
            [a[p][k], a[q][k]] = [c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]];
        }
    }
    return a.map((row, i) => row[i]);
  }

  /* Real and imaginary parts of the FRF in an npz. */
  function curveOf(buffer) {
    const { frequency_hz: hz, values, coherence } = arraysOf(buffer);
    const half = hz.length;
    const take = (shift) => Float64Array.from({ length: half }, (_, i) => values[2 * i + shift]);
    return { hz, re: take(0), im: take(1), coherence: coherence?.subarray(0, half) ?? null };
  }
  return { curveOf, converted, part, nearest, nextPeak, halfPower, randomError, cmif, UNIT };
})();
