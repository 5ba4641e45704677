/* The light fields' numbers, and arithmetic that needs no graphics. */

const RAMP = [[0.0, 0.0, 0.08], [0.23, 0.05, 0.42], [0.16, 0.27, 0.75], [0.05, 0.56, 0.71], [0.13, 0.74, 0.36],
    [0.72, 0.82, 0.13], [0.98, 0.62, 0.10], [0.90, 0.20, 0.13], [1.0, 0.95, 0.92]];
const ROW = 24;
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const luminance = (c) => 179 * (0.265 * c[0] + 0.670 * c[1] + 0.065 * c[2]);
const clamp = (x, lo, hi) => Math.min(Math.max(x, lo), hi);

function bytesOf(text) {
    const raw = atob(text), bytes = new Uint8Array(raw.length);
    for (let k = 0; k < raw.length; k++) bytes[k] = raw.charCodeAt(k);
    return bytes;
}

function half(h) {
    const e = h >> 10 & 31, m = h & 1023, v = e ? (1 + m / 1024) * 2 ** (e - 15) : m * 2 ** -24;
    return h & 0x8000 ? -v : v;
}

/* One light field: its facts, and its arrays as views of one buffer (little-endian, as every browser's machine is). */
function readField(facts, numbers) {
    const f = JSON.parse(facts.textContent), buffer = bytesOf(numbers.textContent).buffer;
    const probes = f.grid[0] * f.grid[1];
    let offset = 0;
    const floats = (n) => { const a = new Float32Array(buffer, offset, n); offset += 4 * n; return a; };
    f.lampRows = floats(f.lamps * ROW);
    f.maskRows = floats(f.masks * ROW);
    f.pictureSamples = floats(f.pictures);
    f.irradiance = floats(probes * 3);
    f.lampLight = floats(f.light[0] * f.light[1] * 3);
    f.halves = new Uint16Array(buffer, offset, probes * (f.texels[0] * f.texels[1] + 2) * 3);
    numbers.textContent = "";
    return f;
}

const readFields = () => {
    const numbers = document.querySelectorAll(".numbers");
    return [...document.querySelectorAll(".facts")].map((facts, k) => readField(facts, numbers[k]));
};

/* The field's own coordinates, and the scene's. */
const toScene = (f, p) => [0, 1, 2].map((k) => f.origin[k] + p[0] * f.u[k] + p[1] * f.v[k] + p[2] * f.n[k]);
const turnToScene = (f, d) => [0, 1, 2].map((k) => d[0] * f.u[k] + d[1] * f.v[k] + d[2] * f.n[k]);
const turnToField = (f, d) => [dot(d, f.u), dot(d, f.v), dot(d, f.n)];
const toField = (f, x) => turnToField(f, x.map((v, k) => v - f.origin[k]));

/* Bilinear between nx x ny points over the plane: three numbers. */
function between(rgb, nx, ny, s, t) {
    const x = clamp(s, 0, 1) * (nx - 1), y = clamp(t, 0, 1) * (ny - 1);
    const i = Math.min(Math.floor(x), Math.max(nx - 2, 0)), j = Math.min(Math.floor(y), Math.max(ny - 2, 0));
    const i1 = Math.min(i + 1, nx - 1), j1 = Math.min(j + 1, ny - 1), a = x - i, b = y - j;
    return [0, 1, 2].map((c) => (1 - b) * ((1 - a) * rgb[3 * (j * nx + i) + c] + a * rgb[3 * (j * nx + i1) + c]) +
        b * ((1 - a) * rgb[3 * (j1 * nx + i) + c] + a * rgb[3 * (j1 * nx + i1) + c]));
}

/* Irradiance of the plane at (x, y) of the field's coordinates, from above: R, G, B. */
function onPlane(f, x, y) {
    const s = x / f.size[0], t = y / f.size[1], e = between(f.irradiance, f.grid[0], f.grid[1], s, t);
    if (!f.lamps) return e;
    const more = between(f.lampLight, f.light[0], f.light[1], s, t);
    return e.map((v, c) => v + more[c]);
}

/* Least and largest illuminance of the plane, lx, as a scale: all of it fits, half a decade at least. */
function planScaleOf(fields) {
    let lo = Infinity, hi = 0;
    for (const f of fields)
        for (let k = 0; k < 4096; k++) {
            const e = luminance(onPlane(f, (k % 64) / 63 * f.size[0], Math.floor(k / 64) / 63 * f.size[1]));
            if (e > 0) { lo = Math.min(lo, e); hi = Math.max(hi, e); }
        }
    if (!(hi > 0)) return {lowest: 0, decades: 1, most: 1};
    const top = Math.log10(hi), decades = clamp(top - Math.log10(lo), 0.5, 5);
    return {lowest: top - decades, decades, most: hi};
}

/* The probes around a place, nearest first: [i, j, weight]. */
function around(f, x, y) {
    const s = clamp(x / f.size[0], 0, 1) * (f.grid[0] - 1), t = clamp(y / f.size[1], 0, 1) * (f.grid[1] - 1);
    const i = Math.min(Math.floor(s), Math.max(f.grid[0] - 2, 0)), j = Math.min(Math.floor(t), Math.max(f.grid[1] - 2, 0));
    const a = s - i, b = t - j;
    return [[i, j, (1 - a) * (1 - b)], [i + 1, j, a * (1 - b)], [i, j + 1, (1 - a) * b], [i + 1, j + 1, a * b]]
        .filter((p) => p[2] > 0).sort((p, q) => q[2] - p[2]);
}

/* The luminance below which 98 % of some of the probes' texels lie: white to begin with. */
function whiteOf(f) {
    const found = [], n = f.halves.length / 3, step = Math.max(1, Math.floor(n / 20000));
    for (let k = 0; k < n; k += step)
        found.push(luminance([half(f.halves[3 * k]), half(f.halves[3 * k + 1]), half(f.halves[3 * k + 2])]) * 2 ** f.scale);
    found.sort((a, b) => a - b);
    return found[Math.floor(0.98 * (found.length - 1))] || found[found.length - 1] || 1;
}

/* A false colour for a value, as the shader has it: 0 to 255. */
function falseColour(value, lowest, decades) {
    const at = value > 0 ? clamp((Math.log10(value) - lowest) / decades, 0, 1) * 8 : 0, k = Math.min(Math.floor(at), 7);
    return [0, 1, 2].map((c) => 255 * (RAMP[k][c] + (at - k) * (RAMP[k + 1][c] - RAMP[k][c])));
}

function said(x, digits = 4) {
    if (!Number.isFinite(x)) return "–";
    const plain = x === 0 || (Math.abs(x) < 1e5 && Math.abs(x) >= 1e-3);
    return plain ? Number(x.toPrecision(digits)).toString() : x.toExponential(digits - 1);
}

const saidAll = (v, digits) => v.map((x) => said(x, digits)).join(" ");
