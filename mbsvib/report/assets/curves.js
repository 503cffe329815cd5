// Frequency and step responses of any pair, computed from the form of the equations (report/form.py).
// The sum over modes is that of mbsvib/responses/modal_sum.py: above its corner a mode contributes its remainder only,
// and the other part is summed in advance, by the side with the smaller terms.
function doubles(code) {
  const bytes = Uint8Array.from(atob(code), (sign) => sign.charCodeAt(0));
  const view = new DataView(bytes.buffer), out = new Float64Array(bytes.length / 8);
  for (let i = 0; i < out.length; i++) out[i] = view.getFloat64(8 * i, true);
  return out;
}

function formOf(packed, inputs) {
  const form = {...packed, inputs, triangular: !packed.blocks.length};
  for (const key of ["a", "b", "rows", "starts", "ends", "d"]) form[key] = doubles(packed[key]);
  let at = 0, first = 0;
  form.parts = packed.blocks.map((size) => {
    const [a, b, c, d] = size === 2 ? form.a.subarray(at, at + 4) : [form.a[at], 0, 0, 0];
    const det = a * d - b * c, total = a + d, half = 0.5 * total, square = det - half * half;  // imaginary part squared
    const slow = square < 0 ? Math.abs(half) + Math.sqrt(-square) : Math.sqrt(Math.abs(det));
    const part = {size, first, a, b, c, d, det, total, corner: size === 2 ? slow : Math.abs(a)};
    at += size * size;
    first += size;
    return part;
  });
  return form;
}

// What one pair needs: for each row its vector, that times A^2, and the sums over the modes below each corner.
function pairOf(form, output, input) {
  const n = form.states, wide = form.triangular ? 2 : 1, rows = [];
  const b = Float64Array.from({length: wide * n}, (_, k) => form.b[wide * (Math.floor(k / wide) * form.inputs + input) + (k % wide)]);
  form.order.forEach((order, r) => {
    if (form.output[r] === output) rows.push({order, r, c: form.rows.subarray(wide * r * n, wide * (r + 1) * n)});
  });
  const pair = {form, b, rows, d: form.d[output * form.inputs + input], sums: form.ends.length > 0};
  if (form.triangular) return pair;
  const sorted = [...form.parts].sort((p, q) => p.corner - q.corner);
  pair.corners = sorted.map((part) => part.corner);
  for (const row of rows) {
    row.c1 = new Float64Array(n);
    row.c2 = new Float64Array(n);
    const terms = sorted.map(({size, first: f, a, b: up, c: low, d, corner}) => {
      const x = row.c[f], y = size === 2 ? row.c[f + 1] : 0, p = x * a + y * low, q = x * up + y * d, right = size === 2 ? b[f + 1] : 0;
      row.c1[f] = p;
      row.c2[f] = p * a + q * low;
      if (size === 2) { row.c1[f + 1] = q; row.c2[f + 1] = p * up + q * d; }
      const alpha = x * b[f] + y * right, gamma = p * b[f] + q * right;
      return {alpha, gamma, weight: Math.abs(p * b[f]) + Math.abs(q * right), slow: Math.abs(x * b[f]) + Math.abs(y * right), corner};
    });
    const at = row.r * form.inputs + input;
    row.start = pair.sums ? form.starts[at] : 0;
    row.end = pair.sums ? form.ends[at] : 0;
    row.alpha = sums(terms.map((t) => t.alpha), terms.map((t) => t.slow), 0, 0);
    row.gamma = sums(terms.map((t) => t.gamma), terms.map((t) => t.weight), row.start, row.end);
  }
  return pair;
}

// start + terms[:j] = total - terms[j:], by the side with less rounding.
function sums(terms, size, start, total) {
  const n = terms.length, up = [start], left = [Math.abs(start)], down = new Array(n + 1), right = new Array(n + 1);
  for (let j = 0; j < n; j++) { up.push(up[j] + terms[j]); left.push(left[j] + size[j]); }
  down[n] = total; right[n] = Math.abs(total);
  for (let j = n - 1; j >= 0; j--) { down[j] = down[j + 1] - terms[j]; right[j] = right[j + 1] + size[j]; }
  return up.map((value, j) => (left[j] <= right[j] ? value : down[j]));
}

// G(i w) of a pair as [real, imaginary].
function responseAt(pair, w) {
  if (pair.form.triangular) return triangularAt(pair, w);
  let re = pair.d, im = 0, below = 0;
  const {b, sums: summed} = pair, add = (x, y, order) => {  // times (i w)^order
    if (order === 0) { re += x; im += y; } else if (order === 1) { re -= w * y; im += w * x; } else { re -= w * w * x; im -= w * w * y; }
  };
  if (summed) while (below < pair.corners.length && pair.corners[below] < w) below++;
  for (const row of pair.rows) {
    let hr = 0, hi = 0, lr = 0, li = 0;
    for (const part of pair.form.parts) {
      const f = part.first, low = summed && part.corner < w, c = low ? row.c2 : row.c;
      let x, y;
      if (part.size === 1) {
        const size = part.a * part.a + w * w;
        x = c[f] * b[f] * -part.a / size;
        y = c[f] * b[f] * -w / size;
      } else {
        // c adj(s - N) b = s c b + c (N - total) b, over s^2 - total s + det
        const b1 = b[f], b2 = b[f + 1], c1 = c[f], c2 = c[f + 1];
        const steady = c1 * (part.b * b2 - part.d * b1) + c2 * (part.c * b1 - part.a * b2), moving = w * (c1 * b1 + c2 * b2);
        const own = Math.sqrt(Math.abs(part.det)), dr = part.det >= 0 ? (own - w) * (own + w) : part.det - w * w, di = -part.total * w;
        const size = dr * dr + di * di;
        x = (steady * dr + moving * di) / size;
        y = (moving * dr - steady * di) / size;
      }
      if (low) { lr += x; li += y; } else { hr += x; hi += y; }
    }
    add(hr, hi, row.order);
    if (!summed) continue;
    const alpha = row.alpha[below], gamma = row.gamma[below];
    if (row.order === 2) {  // s^2 (L / s^2 + alpha / s + gamma / s^2), gamma with D
      re += lr + gamma;
      im += li + w * alpha;
    } else if (below) {
      add(-(lr + gamma) / (w * w), -li / (w * w) - alpha / w, row.order);
    }
  }
  return [re, im];
}

// (s - T) x = b by back substitution, T the upper triangle row by row.
function triangularAt({form, b, rows, d}, w) {
  const n = form.states, x = new Float64Array(2 * n), t = form.a;
  let start = n * (n + 1) / 2;
  for (let i = n - 1; i >= 0; i--) {
    start -= n - i;
    let re = b[2 * i], im = b[2 * i + 1];
    for (let j = i + 1, k = 2 * (start + 1); j < n; j++, k += 2) {
      re += t[k] * x[2 * j] - t[k + 1] * x[2 * j + 1];
      im += t[k] * x[2 * j + 1] + t[k + 1] * x[2 * j];
    }
    const pr = -t[2 * start], pi = w - t[2 * start + 1], size = pr * pr + pi * pi;
    x[2 * i] = (re * pr + im * pi) / size;
    x[2 * i + 1] = (im * pr - re * pi) / size;
  }
  let re = d, im = 0;
  for (const {c} of rows) for (let i = 0; i < n; i++) {
    re += c[2 * i] * x[2 * i] - c[2 * i + 1] * x[2 * i + 1];
    im += c[2 * i] * x[2 * i + 1] + c[2 * i + 1] * x[2 * i];
  }
  return [re, im];
}

// Frequencies [Hz] of a window with values: evenly spaced in log f, around each pole, then halved where the curve bends.
const MOST_POINTS = 6000, BENDS = 0.002;
function sampled(pair, poles, low, high) {
  const grid = new Set();
  for (let k = 0; k <= 400; k++) grid.add(low * (high / low) ** (k / 400));
  for (const [re, im] of poles) {
    const centre = Math.abs(im) / (2 * Math.PI), half = Math.max(Math.abs(re) / (2 * Math.PI), 1e-9 * centre);
    if (!(centre > 0.2 * low && centre < 5 * high)) continue;
    for (let k = -14; k <= 14; k++) {
      const f = centre + half * Math.sinh(0.4 * k);
      if (f > low && f < high) grid.add(f);
    }
  }
  const of = (f) => { const [re, im] = responseAt(pair, 2 * Math.PI * f); return {f, re, im, log: Math.log10(Math.hypot(re, im))}; };
  let points = [...grid].sort((p, q) => p - q).map(of).filter((p) => Number.isFinite(p.re) && Number.isFinite(p.im));
  for (let pass = 0; pass < 24 && points.length < MOST_POINTS; pass++) {
    const logs = points.map((p) => p.log).filter(Number.isFinite), range = Math.max(1e-6, Math.max(...logs) - Math.min(...logs));
    const next = [], count = points.length;
    let split = 0;
    for (let k = 0; k < count; k++) {
      const p = points[k], q = points[k + 1];
      next.push(p);
      if (!q || p.straight || q.f - p.f < 1e-13 * q.f || count + split >= MOST_POINTS) continue;
      const m = of(Math.sqrt(p.f * q.f));
      const turn = Math.abs(Math.atan2(q.im * p.re - q.re * p.im, q.re * p.re + q.im * p.im));
      if (Math.abs(m.log - 0.5 * (p.log + q.log)) > BENDS * range || turn > 0.03) { next.push(m); split++; } else p.straight = true;
    }
    points = next;
    if (!split) break;
  }
  return points;
}

// Phase [deg], continuous; the first value is the one nearest to `near`.
function phases(points, near) {
  let last = near;
  return points.map(({re, im}) => {
    if (re === 0 && im === 0) return null;
    let phase = Math.atan2(re < 0 && Math.abs(im) <= 1e-13 * Math.abs(re) ? -0 : im, re) * 180 / Math.PI;
    if (!Number.isFinite(phase)) return null;  // at a pole without damping
    if (last === undefined) { if (phase > 135) phase -= 360; } else phase -= 360 * Math.round((phase - last) / 360);
    last = phase;
    return phase;
  });
}

// e^(N t) b of a block of one or two states, and its integral from 0 to t.
function motionOf(part, b1, b2, t) {
  const {a, b, c, d, det, total} = part;
  if (part.size === 1) return {now: [Math.exp(a * t) * b1, 0], sum: [b1 * (a === 0 ? t : Math.expm1(a * t) / a), 0]};
  const n1 = a * b1 + b * b2, n2 = c * b1 + d * b2, half = 0.5 * total, square = det - half * half;
  let even, odd;  // e^(N t) = even + odd N
  if (square >= 0) {
    const w = Math.sqrt(square), x = w * t, decay = Math.exp(half * t);
    odd = decay * (x < 1e-4 ? t * (1 - x * x / 6) : Math.sin(x) / w);
    even = decay * Math.cos(x) - half * odd;
  } else {
    const w = Math.sqrt(-square), x = w * t;
    odd = x < 1e-4 ? Math.exp(half * t) * t * (1 + x * x / 6) : (Math.exp((half + w) * t) - Math.exp((half - w) * t)) / (2 * w);
    even = 0.5 * (Math.exp((half + w) * t) + Math.exp((half - w) * t)) - half * odd;
  }
  const now = [even * b1 + odd * n1, even * b2 + odd * n2];
  if (Math.hypot(total, Math.sqrt(Math.abs(det))) * t < 0.7) {  // the series, where the quotient below cancels
    let x = b1 * t, y = b2 * t, sx = x, sy = y;
    for (let k = 2; k < 24; k++) { [x, y] = [(a * x + b * y) * t / k, (c * x + d * y) * t / k]; sx += x; sy += y; }
    return {now, sum: [sx, sy]};
  }
  if (det === 0) {
    const more = total === 0 ? t * t / 2 : (Math.expm1(total * t) / total - t) / total;
    return {now, sum: [b1 * t + n1 * more, b2 * t + n2 * more]};
  }
  const x = now[0] - b1, y = now[1] - b2;
  return {now, sum: [(d * x - b * y) / det, (a * y - c * x) / det]};
}

// Response to a unit step at times [s].
function stepAt(pair, t) {
  let value = pair.d;
  const sums = pair.rows.map((row) => (row.order === 2 ? row.start : 0));
  for (const part of pair.form.parts) {
    const f = part.first, {now, sum} = motionOf(part, pair.b[f], part.size === 2 ? pair.b[f + 1] : 0, t);
    pair.rows.forEach((row, k) => {
      const c = row.order === 2 ? row.c1 : row.c, x = row.order === 0 ? sum : now;
      sums[k] += c[f] * x[0] + (part.size === 2 ? c[f + 1] * x[1] : 0);
    });
  }
  return sums.reduce((all, one) => all + one, value);
}

// e^(M t) of a complex upper triangular matrix, rows of [re, im, ...]: scaled Taylor series, then squared.
function exponential(m, n, t) {
  let norm = 0;
  for (let i = 0; i < n; i++) { let sum = 0; for (let j = i; j < n; j++) sum += Math.hypot(m[2 * (i * n + j)], m[2 * (i * n + j) + 1]); norm = Math.max(norm, sum); }
  const times = (p, q, scale) => {
    const out = new Float64Array(2 * n * n);
    for (let i = 0; i < n; i++) for (let k = i; k < n; k++) {
      const x = p[2 * (i * n + k)] * scale, y = p[2 * (i * n + k) + 1] * scale;
      if (x || y) for (let j = 2 * (k * n + k), o = 2 * (i * n + k), end = 2 * (k * n + n); j < end; j += 2, o += 2) {
        out[o] += x * q[j] - y * q[j + 1];
        out[o + 1] += x * q[j + 1] + y * q[j];
      }
    }
    return out;
  };
  const halvings = Math.max(0, Math.ceil(Math.log2(Math.max(1e-300, norm * t) / 0.5))), h = t / 2 ** halvings;
  let term = new Float64Array(2 * n * n), all = new Float64Array(2 * n * n);
  for (let i = 0; i < n; i++) term[2 * (i * n + i)] = all[2 * (i * n + i)] = 1;
  for (let k = 1; k < 16; k++) { term = times(m, term, h / k); for (let i = 0; i < all.length; i++) all[i] += term[i]; }
  for (let k = 0; k < halvings; k++) all = times(all, all, 1);
  return all;
}

// Step response of a triangular form at equally spaced times: x' = T x + b, one exact step after the other.
function triangularSteps({form, b, rows, d}, from, to, count) {
  const n = form.states, N = n + 1, m = new Float64Array(2 * N * N), h = (to - from) / (count - 1);
  const size = b.reduce((most, value) => Math.max(most, Math.abs(value)), 0) || 1;  // inputs of 1 do not ask for smaller steps
  for (let i = 0, k = 0; i < n; i++) {
    for (let j = i; j < n; j++, k += 2) { m[2 * (i * N + j)] = form.a[k]; m[2 * (i * N + j) + 1] = form.a[k + 1]; }
    m[2 * (i * N + n)] = b[2 * i] / size;
    m[2 * (i * N + n) + 1] = b[2 * i + 1] / size;
  }
  const apply = (e, x) => {
    const out = new Float64Array(2 * N);
    for (let i = 0; i < N; i++) for (let j = i; j < N; j++) {
      const p = 2 * (i * N + j);
      out[2 * i] += e[p] * x[2 * j] - e[p + 1] * x[2 * j + 1];
      out[2 * i + 1] += e[p] * x[2 * j + 1] + e[p + 1] * x[2 * j];
    }
    return out;
  };
  const once = exponential(m, N, h), result = [];
  let x = new Float64Array(2 * N);
  x[2 * n] = 1;
  if (from > 0) x = apply(exponential(m, N, from), x);
  for (let k = 0; k < count; k++) {
    let value = d;
    for (const {c} of rows) for (let i = 0; i < n; i++) value += size * (c[2 * i] * x[2 * i] - c[2 * i + 1] * x[2 * i + 1]);
    result.push({t: from + k * h, y: value});
    x = apply(once, x);
  }
  return result;
}

function steps(pair, from, to) {
  if (pair.form.triangular) return triangularSteps(pair, from, to, 1501);
  let points = Array.from({length: 801}, (_, k) => from + (to - from) * k / 800).map((t) => ({t, y: stepAt(pair, t)}));
  for (let pass = 0; pass < 12 && points.length < MOST_POINTS; pass++) {
    const values = points.map((p) => p.y), range = Math.max(...values) - Math.min(...values) || 1, next = [], count = points.length;
    let split = 0;
    points.forEach((p, k) => {
      const q = points[k + 1];
      next.push(p);
      if (!q || p.straight || count + split >= MOST_POINTS) return;
      const t = 0.5 * (p.t + q.t), y = stepAt(pair, t);
      if (Math.abs(y - 0.5 * (p.y + q.y)) > BENDS * range) { next.push({t, y}); split++; } else p.straight = true;
    });
    points = next;
    if (!split) break;
  }
  return points;
}
