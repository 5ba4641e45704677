/* The plane from above: light on it, probes, lamps, what hides them, and the point that is looked from. */

class Plan {
    constructor(canvas, f, k, app) {
        Object.assign(this, {canvas, f, k, app});
        this.paper = document.createElement("canvas");
    }

    /* What the picture spans, in the field's coordinates: the plane, or all that is known of the room. */
    extent() {
        const [w, h] = this.f.size, longest = Math.max(w, h), edge = 0.12 * longest;
        let box = [-edge, -edge, w + edge, h + edge];
        if (this.app.wide) {
            const more = [...this.lamps().filter((l) => !l.far).map((l) => l.c), ...surfaceCorners(this.f.surfaces[this.f.surface])];
            for (const [x, y] of more) box = [Math.min(box[0], x), Math.min(box[1], y), Math.max(box[2], x), Math.max(box[3], y)];
            const far = 30 * longest, pad = 0.04 * (box[2] - box[0]);
            box = [Math.max(box[0] - pad, -far), Math.max(box[1] - pad, -far), Math.min(box[2] + pad, far), Math.min(box[3] + pad, far)];
        }
        const size = Math.max(box[2] - box[0], (box[3] - box[1])), cx = (box[0] + box[2]) / 2, cy = (box[1] + box[3]) / 2;
        const tall = clamp((box[3] - box[1]) / size, 0.5, 1), wide = clamp((box[2] - box[0]) / size, 0.5, 1);
        return [cx - size * wide / 2, cy - size * tall / 2, cx + size * wide / 2, cy + size * tall / 2];
    }

    lamps() {
        return Array.from({length: this.f.lamps}, (_, k) => lampOf(this.f, k));
    }

    fit() {
        const e = this.box = this.extent(), w = fitWidth(this.canvas), h = Math.round(w * (e[3] - e[1]) / (e[2] - e[0]));
        if (this.canvas.height !== h) this.canvas.height = h;
        this.unit = w / (e[2] - e[0]);
    }

    to(x, y) {
        return [(x - this.box[0]) * this.unit, (this.box[3] - y) * this.unit];
    }

    from(px, py) {
        return [this.box[0] + px / this.unit, this.box[3] - py / this.unit];
    }

    /* The plane's light in colours, as large as it is on the canvas. */
    paint(tone) {
        const f = this.f, w = Math.max(2, Math.round(f.size[0] * this.unit)), h = Math.max(2, Math.round(f.size[1] * this.unit));
        const c = this.paper, layer = this.app.layer;
        const key = [w, h, layer, this.app.height].join(), scale = this.app.planScale;
        if (key === this.painted) return;
        this.painted = key;
        c.width = w;
        c.height = h;
        if (layer >= 0 && layer < f.lamps && this.app.look) {
            const ask = {mode: 7, at: [0, 0, this.app.heightOf(f)], lamp: layer};
            this.app.look.picture(c.getContext("2d"), f, this.k, w, h, ask, tone);
            return;
        }
        const image = new ImageData(w, h);
        for (let y = 0; y < h; y++)
            for (let x = 0; x < w; x++) {
                const e = onPlane(f, (x + 0.5) / w * f.size[0], (1 - (y + 0.5) / h) * f.size[1]);
                const rgb = falseColour(luminance(e), scale.lowest, scale.decades);
                image.data.set([...rgb, 255], 4 * (y * w + x));
            }
        c.getContext("2d").putImageData(image, 0, 0);
    }

    draw(tone, point) {
        this.fit();
        this.paint(tone);
        const g = this.canvas.getContext("2d"), f = this.f, dpr = this.canvas.width / Math.max(1, this.canvas.clientWidth);
        g.clearRect(0, 0, this.canvas.width, this.canvas.height);
        g.drawImage(this.paper, ...this.to(0, f.size[1]), f.size[0] * this.unit, f.size[1] * this.unit);
        g.lineWidth = dpr;
        g.font = `${11 * dpr}px system-ui, sans-serif`;
        this.drawNodes(g, dpr);
        if (this.app.wide) this.drawSurface(g);
        const lamps = this.lamps();
        lamps.forEach((l) => l.masks.forEach((m) => this.drawMask(g, m)));
        lamps.forEach((l, k) => this.drawLamp(g, l, k, dpr));
        this.drawPoint(g, point, dpr);
    }

    drawNodes(g, dpr) {
        const [nu, nv] = this.f.grid, [w, h] = this.f.size, r = Math.min(2.5 * dpr, w * this.unit / nu / 4);
        g.fillStyle = "#fff";
        g.strokeStyle = "#000";
        for (let j = 0; j < nv; j++)
            for (let i = 0; i < nu; i++) {
                g.beginPath();
                g.arc(...this.to(nu > 1 ? w * i / (nu - 1) : w / 2, nv > 1 ? h * j / (nv - 1) : h / 2), Math.max(r, 0.6), 0, 7);
                g.fill();
                if (r > 2) g.stroke();
            }
    }

    polygon(g, points) {
        g.beginPath();
        points.forEach((p, k) => g[k ? "lineTo" : "moveTo"](...this.to(p[0], p[1])));
        g.closePath();
    }

    drawSurface(g) {
        const s = this.f.surfaces[this.f.surface];
        g.strokeStyle = "#9cf";
        if (s.kind === "sphere") {
            g.beginPath();
            g.arc(...this.to(...s.centre), this.unit / Math.hypot(s.M[0], s.M[1], s.M[2]), 0, 7);
            g.stroke();
        }
        if (s.kind !== "box") return;
        const c = surfaceCorners(s);
        for (let a = 0; a < 8; a++)
            for (const bit of [1, 2, 4])
                if (!(a & bit)) {
                    g.beginPath();
                    g.moveTo(...this.to(...c[a]));
                    g.lineTo(...this.to(...c[a | bit]));
                    g.stroke();
                }
    }

    drawLamp(g, l, k, dpr) {
        const [x, y] = this.to(l.c[0], l.c[1]), e = this.canvas, pad = 9 * dpr, name = `${k + 1}`;
        g.setLineDash([]);
        g.strokeStyle = "#fff";
        g.fillStyle = l.off ? "#777" : "#fe65";
        if (x > pad && y > pad && x < e.width - pad && y < e.height - pad && !l.far) {
            this.polygon(g, l.outline);
            g.fill();
            g.stroke();
            g.fillStyle = "#fff";
            g.fillText(`lamp ${name}, ${said(l.c[2], 3)} up`, Math.min(x + 6 * dpr, e.width - 96 * dpr), y - 6 * dpr);
            return;
        }
        /* beyond the picture: an arrow at its edge */
        const cx = e.width / 2, cy = e.height / 2, dx = x - cx, dy = y - cy;
        const q = Math.min((cx - pad) / Math.abs(dx || 1), (cy - pad) / Math.abs(dy || 1));
        const tip = [cx + q * dx, cy + q * dy], a = Math.atan2(dy, dx), s = 7 * dpr;
        g.beginPath();
        g.moveTo(tip[0] + s * Math.cos(a), tip[1] + s * Math.sin(a));
        g.lineTo(tip[0] + s * Math.cos(a + 2.3), tip[1] + s * Math.sin(a + 2.3));
        g.lineTo(tip[0] + s * Math.cos(a - 2.3), tip[1] + s * Math.sin(a - 2.3));
        g.closePath();
        g.fill();
        g.stroke();
        const words = l.far ? `lamp ${name}, far` : `lamp ${name}`, wide = g.measureText(words).width;
        g.fillStyle = "#fff";
        g.fillText(words, clamp(tip[0] - wide / 2, 2, e.width - wide - 2), clamp(tip[1] + (tip[1] < cy ? 20 : -12) * dpr, 12 * dpr, e.height - 3));
    }

    /* A sheet's edges and its picture's frame seen from above, a ball's outline; what else shapes a lamp shows in the plan's layer. */
    drawMask(g, m) {
        g.setLineDash([6, 4]);
        g.strokeStyle = "#f8c";
        if (m.kind === 5) {
            g.beginPath();
            g.arc(...this.to(m.coef[0], m.coef[1]), m.coef[3] * this.unit, 0, 7);
            g.stroke();
        }
        if (m.kind !== 0) return;
        const [x0, y1] = this.to(m.x0, m.y0 + (m.ny - 1) * m.dy), [x1, y0] = this.to(m.x0 + (m.nx - 1) * m.dx, m.y0);
        g.strokeRect(x0, y1, x1 - x0, y0 - y1);
        g.setLineDash([]);
        g.beginPath();
        for (const [ax, ay, bx, by] of m.edges()) {
            g.moveTo(...this.to(ax, ay));
            g.lineTo(...this.to(bx, by));
        }
        g.stroke();
    }

    drawPoint(g, point, dpr) {
        const [x, y] = this.to(point[0], point[1]), r = 9 * dpr;
        for (const [style, width] of [["#000", 4 * dpr], ["#fff", 2 * dpr]]) {
            g.strokeStyle = style;
            g.lineWidth = width;
            g.beginPath();
            g.arc(x, y, r, 0, 7);
            g.moveTo(x - 1.6 * r, y); g.lineTo(x + 1.6 * r, y);
            g.moveTo(x, y - 1.6 * r); g.lineTo(x, y + 1.6 * r);
            g.stroke();
        }
    }
}

/* Give a canvas as many columns as the screen has there, or a share of them. */
function fitWidth(canvas, share = 1) {
    const w = Math.max(40, Math.round(canvas.clientWidth * Math.min(window.devicePixelRatio || 1, 2) * share));
    if (canvas.width !== w) canvas.width = w;
    return w;
}

/* Corners of a box (or of the box around a ball) in the field's coordinates; none for what is infinitely far. */
function surfaceCorners(s) {
    if (s.kind === "far") return [];
    const rows = [0, 1, 2].map((k) => s.M.slice(3 * k, 3 * k + 3)), half = rows.map((r) => r.map((x) => x / dot(r, r)));
    return Array.from({length: 8}, (_, b) => [0, 1, 2].map((c) => s.centre[c] +
        half.reduce((sum, h, k) => sum + (b >> k & 1 ? 1 : -1) * h[c], 0)));
}

const SHAPES = ["sphere", "rectangle", "disc", "tube"];
const MASKS = ["a sheet", "a picture of what arrives", "an outline", "a beam", "sheets (twigs, leaves)", "a ball"];

/* A lamp from its row: place, body's outline from above, and what hides it. */
function lampOf(f, k) {
    const r = f.lampRows.subarray(ROW * k, ROW * k + ROW), c = [r[2], r[3], r[4]], a = [r[5], r[6]], b = [r[8], r[9]];
    const turned = Array.from({length: 24}, (_, n) => [Math.cos(n * Math.PI / 12), Math.sin(n * Math.PI / 12)]);
    const round = (u, v) => turned.map(([p, q]) => [0, 1].map((i) => c[i] + p * u[i] + q * v[i]));
    const corner = (s, t) => [0, 1].map((i) => c[i] + s * a[i] + t * b[i]);
    const len = Math.hypot(...a) || 1, side = [-a[1] / len * r[11], a[0] / len * r[11]];
    const outline = [() => round([r[11], 0], [0, r[11]]), () => [corner(1, 1), corner(-1, 1), corner(-1, -1), corner(1, -1)], () => round(a, b),
        () => [[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([s, t]) => [0, 1].map((i) => c[i] + s * a[i] + t * side[i]))][r[0]]();
    const masks = Array.from({length: r[15]}, (_, m) => maskOf(f, r[20] + m));
    return {c, outline, masks, far: r[1] > 0, rgb: [...r.slice(12, 15)], shape: SHAPES[r[0]], off: !(r[12] || r[13] || r[14])};
}

function maskOf(f, k) {
    const r = f.maskRows.subarray(ROW * k, ROW * k + ROW);
    const [x0, y0, dx, dy, at] = r.subarray(16, 21);
    const m = {kind: r[0], link: r[1], coef: r.subarray(7, 13), nx: r[13], ny: r[14], x0, y0, dx, dy, at, words: MASKS[r[0]]};
    m.edges = () => f.edges?.[k] || ((f.edges ||= {})[k] = edgesOf(f, m));
    return m;
}

/* Where a sheet lets half of the light through: lines (x0, y0, x1, y1), cell by cell of its picture. */
function edgesOf(f, m) {
    const lines = [];
    const over = (i, j) => {
        const v = f.pictureSamples[m.at + j * m.nx + i];
        return m.link ? v : v - 0.5;
    };
    for (let j = 0; j + 1 < m.ny; j++)
        for (let i = 0; i + 1 < m.nx; i++) {
            const found = [];
            for (const [i0, j0, i1, j1] of [[0, 0, 1, 0], [1, 0, 1, 1], [1, 1, 0, 1], [0, 1, 0, 0]]) {
                const p = over(i + i0, j + j0), q = over(i + i1, j + j1), t = p / (p - q);
                if (p < 0 !== q < 0) found.push(m.x0 + m.dx * (i + i0 + t * (i1 - i0)), m.y0 + m.dy * (j + j0 + t * (j1 - j0)));
            }
            for (let k = 0; k + 3 < found.length; k += 4) lines.push(found.slice(k, k + 4));
        }
    return lines;
}
