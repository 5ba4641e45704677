/* What is shown, in one place; the bar's controls change it, and everything is drawn again once a frame. */

const byId = (id) => document.getElementById(id);

function complain(words) {
    byId("message").textContent = words;
}

/* A scale with its numbers: 1, 2 and 5 of each decade, as many as there is room for. */
function drawScale(c, {lowest, decades}, words) {
    const w = fitWidth(c), unit = w / Math.max(1, c.clientWidth), h = Math.round(12 * unit), g = c.getContext("2d");
    c.height = Math.round(34 * unit);
    for (let x = 0; x < w; x++) {
        g.fillStyle = `rgb(${falseColour(10 ** (lowest + (x + 0.5) / w * decades), lowest, decades).map(Math.round).join()})`;
        g.fillRect(x, 0, 1, h);
    }
    g.fillStyle = "#fff";
    g.fillRect(0, h, w, c.height - h);
    g.fillStyle = "#000";
    g.font = `${11 * unit}px system-ui, sans-serif`;
    let end = 0;
    for (let d = Math.floor(lowest); d <= lowest + decades; d++)
        for (const m of decades > 3 ? [1] : [1, 2, 5]) {
            const v = m * 10 ** d, x = (Math.log10(v) - lowest) / decades * w, wide = g.measureText(words(v)).width;
            const left = clamp(x - wide / 2, 0, w - wide);
            if (x < 0 || x > w) continue;
            g.fillRect(x, h, unit, 5 * unit);
            if (left < end) continue;
            g.fillText(words(v), left, h + 17 * unit);
            end = left + wide + 10 * unit;
        }
}

class App {
    constructor() {
        this.fields = readFields();
        this.fields.forEach((f) => { f.surface = 0; });
        this.white = Math.max(...this.fields.map(whiteOf)) || 1;
        this.planScale = planScaleOf(this.fields);
        /* so that the brightest place's ball is not all white */
        this.mattStops = Math.min(0, Math.floor(Math.log2(this.white / (0.8 / Math.PI * this.planScale.most))));
        this.reset();
        this.look = null;
        if (!location.hash.includes("nogl"))
            try { this.look = new Look(this.fields); } catch (e) { complain(e.message); }
        else complain(FACE_WORDS);
        document.body.classList.toggle("plain", !this.look);
        this.panels = this.fields.map((f, k) => new Panel(f, k, this));
        byId("fields").append(...this.panels.map((p) => p.root));
        byId("fields").style.setProperty("--fields", this.fields.length);
        byId("fields").classList.toggle("two", this.fields.length > 1);
        this.controls();
        new ResizeObserver(() => this.later()).observe(document.body);
        this.draw();
    }

    reset() {
        const f = this.fields[0];
        Object.assign(this, {stops: 0, falseColour: false, decades: 4, projection: 0, height: 0, layer: -1, wide: false,
            yaw: Math.PI / 2, pitch: 0.75, zoom: 1.2});
        this.place = toScene(f, [f.size[0] / 2, f.size[1] / 2, 0]);
    }

    /* ---- the point: kept in the scene's coordinates, so that two fields are looked at from the same place ---- */

    pointOf(f) {
        const p = toField(f, this.place);
        return [p[0], p[1], this.heightOf(f)];
    }

    heightOf(f) {
        return this.height * Math.max(...f.size);
    }

    movePoint(f, x, y) {
        this.place = toScene(f, [clamp(x, 0, f.size[0]), clamp(y, 0, f.size[1]), 0]);
        this.later();
    }

    turn(across, up) {
        this.yaw -= across * 2 * this.zoom;
        this.pitch = clamp(this.pitch + up * 2 * this.zoom, -0.2, Math.PI / 2);
        this.later();
    }

    zoomBy(factor) {
        this.zoom = clamp(this.zoom * factor, 0.02, 4);
        this.later();
    }

    /* ---- drawing ---- */

    tone() {
        const top = Math.log10(this.white) + 1.5 - this.stops * Math.log10(2);
        return {gain: 179 * 2 ** this.stops / this.white, lowest: top - this.decades, decades: this.decades,
            falseColour: this.falseColour, stops: this.stops};
    }

    later() {
        if (this.waiting) return;
        this.waiting = true;
        requestAnimationFrame(() => this.draw(this.took > 80 ? 0.4 : 1));
    }

    /* With a share of the pixels where the graphics are slow and something moves, whole a moment later. */
    draw(share = 1) {
        const begun = performance.now();
        this.waiting = false;
        this.share = share;
        clearTimeout(this.whole);
        const tone = this.tone();
        this.showControls();
        drawScale(byId("legend"), tone, (v) => `${said(v)} cd/m²`);
        this.panels.forEach((p) => p.draw(tone));
        if (share < 1) this.whole = setTimeout(() => this.draw(), 250);
        else this.took = performance.now() - begun;
    }

    /* ---- the bar ---- */

    controls() {
        const on = (id, event, act) => byId(id).addEventListener(event, (e) => { act(e.target); this.later(); });
        const lamps = Math.max(...this.fields.map((f) => f.lamps)), surfaces = this.fields[0].surfaces;
        byId("bar").addEventListener("submit", (e) => e.preventDefault());
        byId("surface").append(...surfaces.map((s, k) => new Option(s.words, k)));
        byId("layer").append(new Option("irradiance, false colour", -1));
        if (this.look) for (let k = 0; k < lamps; k++) byId("layer").append(new Option(`how much of lamp ${k + 1} comes there`, k));
        on("stops", "input", (e) => { this.stops = Number(e.value); });
        on("false", "change", (e) => { this.falseColour = e.checked; });
        on("decades", "change", (e) => { this.decades = Number(e.value); });
        on("projection", "change", (e) => { this.projection = Number(e.value); });
        on("height", "input", (e) => { this.height = Number(e.value); });
        on("layer", "change", (e) => { this.layer = Number(e.value); });
        on("wide", "change", (e) => { this.wide = e.checked; });
        on("surface", "change", (e) => this.chooseSurface(Number(e.value)));
        on("reset", "click", () => { this.chooseSurface(0); this.reset(); });
        document.addEventListener("keydown", (e) => this.key(e));
    }

    /* Of the second field the geometry of the same kind, if it has one. */
    chooseSurface(k) {
        const kind = this.fields[0].surfaces[k].kind;
        this.fields.forEach((f, n) => { f.surface = n ? Math.max(0, f.surfaces.findIndex((s) => s.kind === kind)) : k; });
    }

    key(e) {
        if (e.ctrlKey || e.altKey || e.metaKey || e.target.matches("select")) return;
        if (e.key === "[") this.stops = Math.max(this.stops - 0.5, -12);
        else if (e.key === "]") this.stops = Math.min(this.stops + 0.5, 12);
        else if (e.key === "f") this.falseColour = !this.falseColour;
        else return;
        this.later();
    }

    showControls() {
        const put = (id, what, value) => { if (byId(id)[what] !== value) byId(id)[what] = value; };
        put("stops", "value", String(this.stops));
        put("stopsSaid", "textContent", `${this.stops > 0 ? "+" : ""}${this.stops} stops`);
        put("false", "checked", this.falseColour);
        put("decades", "value", String(this.decades));
        put("projection", "value", String(this.projection));
        put("surface", "value", String(this.fields[0].surface));
        put("height", "value", String(this.height));
        put("heightSaid", "textContent", said(this.heightOf(this.fields[0]), 3));
        put("layer", "value", String(this.layer));
        put("wide", "checked", this.wide);
    }

    /* ---- for tests: rays [ox oy oz dx dy dz] in the scene's coordinates; R G B and the place where each meets the room ---- */

    ask(k, rays) {
        const f = this.fields[k];
        return rays.map((r) => {
            const d = turnToField(f, r.slice(3, 6)), len = Math.hypot(...d);
            const {rgb, hit} = this.look.ray(f, k, toField(f, r.slice(0, 3)), d.map((x) => x / len));
            return {rgb, hit: hit && toScene(f, hit)};
        });
    }
}

window.ilfview = new App();
