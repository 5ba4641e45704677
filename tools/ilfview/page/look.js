/* WebGL2: the light fields' textures, and rays looked up: pictures to a canvas, numbers to arrays. */

const FACE_WORDS = "This browser shows no WebGL 2, which draws the picture, the balls and what hides lamps. " +
    "The plan and its numbers are here without it.";
const NOT_TAKEN = "This browser's WebGL 2 does not take the page's program: ";
const TOO_LARGE = "This browser's graphics take no textures as large as this light field's: make the page smaller (ilfview --size-mb).";

class Look {
    /* Throws words where it can't. */
    constructor(fields) {
        this.canvas = document.createElement("canvas");
        const gl = this.gl = this.canvas.getContext("webgl2", {premultipliedAlpha: false, antialias: false, preserveDrawingBuffer: true});
        if (!gl) throw new Error(FACE_WORDS);
        this.canvas.addEventListener("webglcontextlost", () => complain("The browser took this page's graphics away: load it again."));
        const text = document.getElementById("shader").textContent;
        this.colours = this.program(text, "");
        this.values = this.program(text, "#define VALUES\n");
        gl.bindVertexArray(gl.createVertexArray());
        gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
        this.sets = fields.map((f) => this.upload(f));
        this.target = {w: 0, h: 0, frame: gl.createFramebuffer(), texture: gl.createTexture()};
    }

    program(text, define) {
        const gl = this.gl, p = gl.createProgram();
        const corners = "#version 300 es\nvoid main() { gl_Position = vec4(gl_VertexID == 1 ? 3. : -1., gl_VertexID == 2 ? 3. : -1., 0., 1.); }";
        for (const [kind, source] of [[gl.VERTEX_SHADER, corners], [gl.FRAGMENT_SHADER, "#version 300 es\n" + define + text]]) {
            const s = gl.createShader(kind);
            gl.shaderSource(s, source);
            gl.compileShader(s);
            gl.attachShader(p, s);
            if (!gl.getShaderParameter(s, gl.COMPILE_STATUS)) throw new Error(NOT_TAKEN + gl.getShaderInfoLog(s));
        }
        gl.linkProgram(p);
        if (!gl.getProgramParameter(p, gl.LINK_STATUS)) throw new Error(NOT_TAKEN + gl.getProgramInfoLog(p));
        const at = {};
        for (let k = gl.getProgramParameter(p, gl.ACTIVE_UNIFORMS) - 1; k >= 0; k--) {
            const name = gl.getActiveUniform(p, k).name.replace("[0]", "");
            at[name] = gl.getUniformLocation(p, name);
        }
        return {p, at};
    }

    /* n texels of `parts` numbers in a texture 2^shift wide. */
    texture(data, n, parts, formats, leastShift) {
        const gl = this.gl, most = gl.getParameter(gl.MAX_TEXTURE_SIZE);
        let shift = leastShift;
        while (n > most << shift && 2 << shift <= most) shift++;
        const w = 1 << shift, h = Math.max(1, Math.ceil(n / w));
        if (h > most) throw new Error(TOO_LARGE);
        const t = gl.createTexture(), whole = Math.floor(n / w);
        gl.bindTexture(gl.TEXTURE_2D, t);
        gl.texStorage2D(gl.TEXTURE_2D, 1, formats[0], w, h);
        const put = (y, across, down, from, to) => gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, y, across, down, formats[1], formats[2],
            data.subarray(from * parts, to * parts));
        if (whole) put(0, w, whole, 0, whole * w);
        if (n > whole * w) put(whole, n - whole * w, 1, whole * w, n);
        gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
        gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
        return {t, shift};
    }

    upload(f) {
        const gl = this.gl, rows = new Float32Array([...f.lampRows, ...f.maskRows, 0, 0, 0, 0]);
        return {
            probes: this.texture(f.halves, f.halves.length / 3, 3, [gl.RGB16F, gl.RGB, gl.HALF_FLOAT], 11),
            rows: this.texture(rows, rows.length / 4, 4, [gl.RGBA32F, gl.RGBA, gl.FLOAT], 11),
            pictures: this.texture(f.pictures ? f.pictureSamples : new Float32Array(1), Math.max(f.pictures, 1), 1, [gl.R32F, gl.RED, gl.FLOAT], 11),
            matt: this.texture(new Float32Array(NORMALS[0] * NORMALS[1] * 4), NORMALS[0] * NORMALS[1], 4, [gl.RGBA32F, gl.RGBA, gl.FLOAT], 6),
        };
    }

    setMatt(k, light) {
        const gl = this.gl;
        gl.bindTexture(gl.TEXTURE_2D, this.sets[k].matt.t);
        gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, ...NORMALS, gl.RGBA, gl.FLOAT, light);
    }

    /* What both programs ask for; `ask` overrides: mode, at, eye (right, up, forward), lens, lamp ... */
    use(prog, f, k, w, h, ask) {
        const gl = this.gl, at = prog.at, set = this.sets[k], s = f.surfaces[f.surface], m = s.M;
        gl.useProgram(prog.p);
        ["probes", "rows", "pictures", "matt"].forEach((name, unit) => {
            gl.activeTexture(gl.TEXTURE0 + unit);
            gl.bindTexture(gl.TEXTURE_2D, set[name].t);
            gl.uniform1i(at[name] ?? null, unit);
        });
        gl.uniform1i(at.shift ?? null, set.probes.shift);
        gl.uniform1i(at.pictureShift ?? null, set.pictures.shift);
        gl.uniform4i(at.grid, f.grid[0], f.grid[1], f.texels[0], f.texels[1]);
        gl.uniform2f(at.size, f.size[0], f.size[1]);
        gl.uniform3f(at.polar, f.polar[0], Math.min(...f.polar), f.polar[0] > Math.PI - 1e-6 ? 1 : 0);
        gl.uniform1f(at.scale ?? null, 2 ** f.scale);
        gl.uniform1i(at.surfaceKind, ["far", "sphere", "box"].indexOf(s.kind));
        gl.uniform3fv(at.surfaceCentre, s.centre);
        gl.uniformMatrix3fv(at.surfaceMap, false, [m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]]);
        gl.uniform1i(at.lampCount, f.lamps);
        gl.uniform1i(at.mode, ask.mode);
        gl.uniform3fv(at.at, ask.at);
        gl.uniformMatrix3fv(at.eye, false, (ask.eye || [[1, 0, 0], [0, 1, 0], [0, 0, 1]]).flat());
        gl.uniform4f(at.lens, ...(ask.lens || [1, 1]), w, h);
        gl.uniform1i(at.lamp, ask.lamp || 0);
        gl.uniform4f(at.cone, ask.cone || 0, 0, 0, 0);
        gl.viewport(0, 0, w, h);
    }

    /* A picture of w x h pixels, drawn into a canvas's context. */
    picture(context, f, k, w, h, ask, tone) {
        const gl = this.gl, at = this.colours.at;
        if (this.canvas.width < w || this.canvas.height < h) {
            this.canvas.width = Math.max(w, this.canvas.width);
            this.canvas.height = Math.max(h, this.canvas.height);
        }
        gl.bindFramebuffer(gl.FRAMEBUFFER, null);
        this.use(this.colours, f, k, w, h, ask);
        gl.uniform1f(at.gain, tone.gain);
        gl.uniform2f(at.decades, tone.lowest, tone.decades);
        gl.uniform1i(at.falseColour, tone.falseColour ? 1 : 0);
        gl.uniform3fv(at.ramp, RAMP.flat());
        gl.drawArrays(gl.TRIANGLES, 0, 3);
        context.clearRect(0, 0, w, h);
        context.drawImage(this.canvas, 0, this.canvas.height - h, w, h, 0, 0, w, h);
    }

    /* Numbers of w x h pixels, four each: R G B (or a place) and 1 where the ray meets the room. */
    numbers(f, k, w, h, ask) {
        const gl = this.gl, t = this.target;
        gl.bindFramebuffer(gl.FRAMEBUFFER, t.frame);
        if (t.w !== w || t.h !== h) {
            gl.deleteTexture(t.texture);
            t.texture = gl.createTexture();
            gl.activeTexture(gl.TEXTURE7);
            gl.bindTexture(gl.TEXTURE_2D, t.texture);
            gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32UI, w, h);
            gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, t.texture, 0);
            t.w = w;
            t.h = h;
        }
        this.use(this.values, f, k, w, h, ask);
        gl.uniform1i(this.values.at.asked, ask.asked || 0);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
        const bits = new Uint32Array(w * h * 4);
        gl.readPixels(0, 0, w, h, gl.RGBA_INTEGER, gl.UNSIGNED_INT, bits);
        gl.bindFramebuffer(gl.FRAMEBUFFER, null);
        return new Float32Array(bits.buffer);
    }

    /* One ray, in the field's own coordinates: its radiance, and where it meets the room (null: infinitely far away). */
    ray(f, k, o, d) {
        const ask = {mode: 4, at: o, eye: [[1, 0, 0], [0, 1, 0], d]};
        const rgb = [...this.numbers(f, k, 1, 1, ask)].slice(0, 3);
        const h = this.numbers(f, k, 1, 1, {...ask, asked: 1}), met = new Uint32Array(h.buffer)[3];
        return {rgb, hit: met ? [h[0], h[1], h[2]] : null};
    }
}

/* ---- light at a point, from all sides: 64 x 32 bundles of rays from above, each with its mean direction ---- */

const BUNDLES = [64, 32], NORMALS = [64, 33];

function bundlesAt(look, f, k, o) {
    const [nt, np] = BUNDLES, flux = new Float64Array(nt * np * 3), way = new Float64Array(nt * np * 3);
    const add = (d, sr, r, g, b) => {
        if (d[2] <= 0) return;
        const x = Math.min(Math.floor((Math.atan2(d[1], d[0]) / Math.PI + 1) / 2 * nt), nt - 1);
        const y = Math.min(Math.floor(Math.acos(Math.min(d[2], 1)) / Math.PI * 2 * np), np - 1), at = 3 * (y * nt + x);
        const w = sr * (Math.abs(r) + Math.abs(g) + Math.abs(b)) + 1e-30;
        flux[at] += sr * r; flux[at + 1] += sr * g; flux[at + 2] += sr * b;
        way[at] += w * d[0]; way[at + 1] += w * d[1]; way[at + 2] += w * d[2];
    };
    const w = clamp(f.texels[0], 64, 1024), h = clamp(Math.ceil(f.texels[1] * Math.PI / 2 / f.polar[0]), 32, 256);
    const v = look.numbers(f, k, w, h, {mode: 5, at: o});
    for (let y = 0; y < h; y++) {
        const lo = (h - 1 - y) / h * Math.PI / 2, hi = (h - y) / h * Math.PI / 2, p = (lo + hi) / 2;
        const sr = (Math.cos(lo) - Math.cos(hi)) * 2 * Math.PI / w;
        for (let x = 0; x < w; x++) {
            const t = ((x + 0.5) / w * 2 - 1) * Math.PI, at = 4 * (y * w + x);
            add([Math.sin(p) * Math.cos(t), Math.sin(p) * Math.sin(t), Math.cos(p)], sr, v[at], v[at + 1], v[at + 2]);
        }
    }
    for (let lamp = 0; lamp < f.lamps; lamp++) addLamp(look, f, k, o, lamp, add);
    for (let k = 0; k < way.length; k += 3) {
        const len = Math.hypot(way[k], way[k + 1], way[k + 2]) || 1;
        for (let c = 0; c < 3; c++) way[k + c] /= len;
    }
    return {flux, way};
}

/* A lamp by rays within the cone that holds it. */
function addLamp(look, f, k, o, lamp, add) {
    const n = 32, r = f.lampRows.subarray(lamp * ROW, lamp * ROW + ROW), e = [r[2] - o[0], r[3] - o[1], r[4] - o[2]];
    const len = Math.hypot(...e), extent = lampExtent(r), z = e.map((x) => x / len);
    const gap = 1 - (len > extent ? Math.sqrt(1 - (extent / len) ** 2) : -1), [x, y] = basis(z);
    const v = look.numbers(f, k, n, n, {mode: 6, at: o, eye: [x, y, z], lamp, cone: gap});
    for (let j = 0; j < n; j++)
        for (let i = 0; i < n; i++) {
            const c = 1 - (i + 0.5) / n * gap, s = Math.sqrt(Math.max(0, 1 - c * c)), t = Math.PI * 2 * (j + 0.5) / n, at = 4 * (j * n + i);
            if (v[at] || v[at + 1] || v[at + 2])
                add([0, 1, 2].map((a) => s * Math.cos(t) * x[a] + s * Math.sin(t) * y[a] + c * z[a]), 2 * Math.PI * gap / (n * n),
                    v[at], v[at + 1], v[at + 2]);
        }
}

function lampExtent(r) {
    const a = Math.hypot(r[5], r[6], r[7]), b = Math.hypot(r[8], r[9], r[10]);
    return [r[11], Math.hypot(a, b), Math.max(a, b), a + r[11]][r[0]];
}

function basis(n) {
    const s = n[2] < 0 ? -1 : 1, a = -1 / (s + n[2]), b = n[0] * n[1] * a;
    return [[1 + s * n[0] * n[0] * a, s * b, -s * n[0]], [b, s + n[1] * n[1] * a, -n[1]]];
}

/* Irradiance of a surface that faces a normal. */
function facing(bundles, n) {
    const {flux, way} = bundles;
    let r = 0, g = 0, b = 0;
    for (let k = 0; k < flux.length; k += 3) {
        const c = way[k] * n[0] + way[k + 1] * n[1] + way[k + 2] * n[2];
        if (c > 0) { r += c * flux[k]; g += c * flux[k + 1]; b += c * flux[k + 2]; }
    }
    return [r, g, b];
}

/* Of NORMALS, as the shader's map has them: columns around, rows from pole to pole, both included. */
function mattMap(bundles) {
    const [nx, ny] = NORMALS, light = new Float32Array(nx * ny * 4);
    for (let j = 0; j < ny; j++)
        for (let i = 0; i < nx; i++) {
            const t = (i / nx * 2 - 1) * Math.PI, p = j / (ny - 1) * Math.PI;
            light.set(facing(bundles, [Math.sin(p) * Math.cos(t), Math.sin(p) * Math.sin(t), Math.cos(p)]), 4 * (j * nx + i));
        }
    return light;
}
