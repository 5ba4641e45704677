/* One light field's part of the page: its canvases, what the pointer does there, and its numbers in words. */

const VIEW_ASPECT = 0.66;
const ARROWS = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]};

const element = (tag, attributes, ...children) => {
    const e = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) e.setAttribute(name, value);
    e.append(...children);
    return e;
};

class Panel {
    constructor(f, k, app) {
        Object.assign(this, {f, k, app, pointer: null});
        const canvas = (label, focus) => element("canvas", {role: "img", "aria-label": label, ...(focus ? {tabindex: 0} : {})});
        this.planCanvas = canvas(`${f.name}: the plane from above; arrow keys move the point`, true);
        this.viewCanvas = canvas(`${f.name}: what arrives at the point; arrow keys turn it, plus and minus zoom`, true);
        this.mirrorCanvas = canvas("a mirror ball at the point");
        this.mattCanvas = canvas("a matt ball at the point");
        this.planLegend = element("canvas", {class: "legendOfPlan", role: "img", "aria-label": "scale of the plan, lx"});
        this.planWords = element("span", {});
        this.mattWords = element("span", {});
        this.table = element("table", {"aria-live": "polite"});
        const figure = (name, words, c) => element("figure", {class: name}, c, element("figcaption", {}, ...words));
        const stored = f.stored.join(" × "), here = f.texels.join(" × ");
        const facts = `${f.grid.join(" × ")} probes of ${here} texels${here === stored ? "" : ` (${stored} in the file)`}, ` +
            (f.lamps ? `${f.lamps} lamp${f.lamps > 1 ? "s" : ""} taken out` : "all light in the probes");
        this.root = element("section", {class: "field"},
            element("div", {class: "head"}, element("h2", {}, f.name), element("div", {}, facts)),
            figure("plan", [this.planLegend, this.planWords], this.planCanvas),
            figure("view", ["what arrives at the point"], this.viewCanvas),
            element("div", {class: "balls"}, figure("", ["mirror ball"], this.mirrorCanvas), figure("", [this.mattWords], this.mattCanvas)),
            element("div", {class: "words"}, this.table));
        this.plan = new Plan(this.planCanvas, f, k, app);
        this.listen();
    }

    /* The point in this field's own coordinates. */
    point() {
        return this.app.pointOf(this.f);
    }

    /* ---- what the pointer and the keys do ---- */

    listen() {
        const place = (e, c) => [e.offsetX / c.clientWidth * c.width, e.offsetY / c.clientHeight * c.height];
        const drag = (c, moved, over) => {
            let last = null;
            c.addEventListener("pointerdown", (e) => {
                c.setPointerCapture(e.pointerId);
                last = place(e, c);
                c.focus();
                moved(last, last);
                e.preventDefault();
            });
            c.addEventListener("pointermove", (e) => { const p = place(e, c); if (last) { moved(p, last); last = p; } over(p); });
            for (const end of ["pointerup", "pointercancel"]) c.addEventListener(end, () => { last = null; });
            c.addEventListener("pointerleave", () => over(null));
        };
        drag(this.planCanvas, (p) => this.app.movePoint(this.f, ...this.plan.from(...p)), (p) => this.over("plan", p));
        drag(this.viewCanvas, (p, q) => this.app.turn((q[0] - p[0]) / this.viewCanvas.width, (p[1] - q[1]) / this.viewCanvas.width),
            (p) => this.over("view", p));
        this.viewCanvas.addEventListener("wheel", (e) => { this.app.zoomBy(e.deltaY > 0 ? 1.1 : 1 / 1.1); e.preventDefault(); }, {passive: false});
        this.planCanvas.addEventListener("keydown", (e) => this.planKey(e));
        this.viewCanvas.addEventListener("keydown", (e) => this.viewKey(e));
    }

    over(where, p) {
        const came = !p !== !this.pointer;
        this.pointer = p && {where, p};
        if (came) this.app.later();
        else requestAnimationFrame(() => this.say());
    }

    planKey(e) {
        const step = Math.max(...this.f.size) / (e.shiftKey ? 200 : 40), way = ARROWS[e.key];
        if (!way) return;
        const p = this.point();
        this.app.movePoint(this.f, p[0] + step * way[0], p[1] + step * way[1]);
        e.preventDefault();
    }

    viewKey(e) {
        const step = 0.05, way = ARROWS[e.key];
        if (way) this.app.turn(way[0] * step, way[1] * step);
        else if (e.key === "+" || e.key === "=") this.app.zoomBy(1 / 1.1);
        else if (e.key === "-") this.app.zoomBy(1.1);
        else return;
        e.preventDefault();
    }

    /* ---- pictures ---- */

    draw(tone) {
        this.explain();
        this.plan.draw(tone, this.point());
        if (this.app.look) this.drawLight(tone);
        this.say();
    }

    /* What the plan and the matt ball show. */
    explain() {
        const {app, f} = this, lamp = app.layer >= 0 && app.layer < f.lamps;
        this.planLegend.hidden = lamp;
        if (!lamp) drawScale(this.planLegend, app.planScale, (v) => `${said(v)} lx`);
        this.planWords.textContent = "the plane from above, u to the right, v up: " +
            (lamp ? `white where all of lamp ${app.layer + 1} comes, black where nothing of it does` : "its irradiance");
        this.mattWords.textContent = app.mattStops && !app.falseColour ? `matt ball, ${-app.mattStops} stops darker` : "matt ball";
    }

    drawLight(tone) {
        const {app, f, k} = this, o = this.point(), key = [...o, f.surface].join();
        if (key !== this.litFor) {
            this.litFor = key;
            this.bundles = bundlesAt(app.look, f, k, o);
            app.look.setMatt(k, mattMap(this.bundles));
        }
        const paint = (c, aspect, ask, own = tone) => {
            const w = fitWidth(c, app.share), h = Math.round(w * aspect);
            if (c.height !== h) c.height = h;
            app.look.picture(c.getContext("2d"), f, k, w, h, {at: o, ...ask}, own);
        };
        paint(this.viewCanvas, VIEW_ASPECT, this.viewAsk());
        this.cross();
        paint(this.mirrorCanvas, 1, {mode: 2, eye: eyeOf(app.yaw, -0.5), lens: [1.04, 1.04]});
        paint(this.mattCanvas, 1, {mode: 3, eye: eyeOf(app.yaw, -0.5), lens: [1.04, 1.04]}, {...tone, gain: tone.gain * 2 ** app.mattStops});
    }

    viewAsk() {
        const {app} = this;
        if (app.projection === 1) return {mode: 1, lens: [1.02 / VIEW_ASPECT, 1.02]};
        return {mode: 0, eye: eyeOf(app.yaw, app.pitch), lens: [app.zoom, app.zoom * VIEW_ASPECT]};
    }

    /* Where the numbers are read when no pointer is there. */
    cross() {
        if (document.activeElement !== this.viewCanvas || this.pointer?.where === "view") return;
        const g = this.viewCanvas.getContext("2d"), x = this.viewCanvas.width / 2, y = this.viewCanvas.height / 2;
        for (const [style, width] of [["#000", 4], ["#fff", 1.5]]) {
            g.strokeStyle = style;
            g.lineWidth = width;
            g.strokeRect(x - 7, y - 7, 14, 14);
        }
    }

    /* The direction of a pixel of the view; null: none. */
    directionAt(p) {
        const c = this.viewCanvas, ask = this.viewAsk(), x = (2 * p[0] / c.width - 1) * ask.lens[0], y = (1 - 2 * p[1] / c.height) * ask.lens[1];
        if (ask.mode === 1) {
            const r = Math.hypot(x, y), q = r * Math.PI / 2;
            return r < 1 ? [r > 0 ? Math.sin(q) * x / r : 0, r > 0 ? Math.sin(q) * y / r : 0, Math.cos(q)] : null;
        }
        const [right, up, ahead] = ask.eye, d = ahead.map((v, k) => v + x * right[k] + y * up[k]), len = Math.hypot(...d);
        return d.map((v) => v / len);
    }

    /* ---- numbers ---- */

    say() {
        const {f} = this, o = this.point(), rows = [];
        const put = (name, words) => rows.push(element("tr", {}, element("th", {scope: "row"}, name), element("td", {}, words)));
        put("point", saidAll(toScene(f, o)) + (this.inside(o) ? "" : " (beyond the plane: the nearest place of its edge counts)"));
        if (this.bundles) {
            const e = facing(this.bundles, [0, 0, 1]);
            put("light there, from above", `${said(luminance(e))} lx, R G B ${saidAll(e)}`);
        }
        if (this.pointer?.where === "plan") this.sayPlan(put, this.plan.from(...this.pointer.p));
        else if (this.app.look) this.sayRay(put, o, this.directionAt(this.pointer?.p || [this.viewCanvas.width / 2, this.viewCanvas.height / 2]));
        for (let k = 0; k < f.lamps; k++) {
            const l = lampOf(f, k), hides = l.masks.map((m) => m.words).join(", ") || "nothing";
            put(`lamp ${k + 1}`, `${l.off ? "put out; " : ""}${l.shape} at ${saidAll(toScene(f, l.c), 3)}${l.far ? ", far away" : ""}, ` +
                `${said(luminance(l.rgb), 3)} cd/m²; behind ${hides}`);
        }
        this.table.replaceChildren(...rows);
    }

    inside(p) {
        return p[0] >= 0 && p[1] >= 0 && p[0] <= this.f.size[0] && p[1] <= this.f.size[1];
    }

    sayPlan(put, p) {
        if (!this.inside(p)) return;
        const e = onPlane(this.f, ...p);
        put("plane under the pointer", saidAll(toScene(this.f, [...p, 0])));
        put("irradiance", `${said(luminance(e))} lx, R G B ${saidAll(e)}`);
        put("probes", this.probesAt(p));
    }

    sayRay(put, o, d) {
        if (!d || d[2] <= 0) {
            put("under the pointer", "below the plane: nothing is known");
            return;
        }
        const {rgb, hit} = this.app.look.ray(this.f, this.k, o, d), from = hit || o, p = [0, 1].map((k) => from[k] - d[k] * from[2] / d[2]);
        put(this.pointer ? "under the pointer" : "in the middle", `${said(luminance(rgb))} cd/m²`);
        put("R G B", saidAll(rgb, 5));
        const degrees = (a) => `${said(a * 180 / Math.PI, 3)}°`;
        put("direction", `${saidAll(turnToScene(this.f, d).map((x) => Number(x.toFixed(5))))}; θ ${degrees(Math.atan2(d[1], d[0]))}, φ ${degrees(Math.acos(d[2]))}`);
        put("probes", this.probesAt(p) + (hit ? `, towards ${saidAll(toScene(this.f, hit))}` : ""));
    }

    probesAt(p) {
        return around(this.f, ...p).map(([i, j, w]) => `(${i},${j}) ${Math.round(100 * w)} %`).join(", ");
    }
}

/* Right, up and forward of an eye; the plane's normal is above. */
function eyeOf(yaw, pitch) {
    const ahead = [Math.cos(pitch) * Math.cos(yaw), Math.cos(pitch) * Math.sin(yaw), Math.sin(pitch)];
    const right = [Math.sin(yaw), -Math.cos(yaw), 0];
    const up = [-Math.sin(pitch) * Math.cos(yaw), -Math.sin(pitch) * Math.sin(yaw), Math.cos(pitch)];
    return [right, up, ahead];
}
