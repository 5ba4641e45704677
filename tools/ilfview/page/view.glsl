/* The radiance of a ray, after docs/FORMAT.md section 2, in the field's own coordinates (x along u, y along v, z along n,
   from probe (0, 0)), and the pictures made of it.  VALUES is defined where numbers are wanted in place of colours. */
precision highp float;
precision highp int;
precision highp sampler2D;

uniform sampler2D probes, rows, pictures, matt;
uniform int shift, pictureShift;    /* log2 of the textures' widths */
uniform ivec4 grid;                 /* probes along u, v; texels of one along azimuth, polar angle */
uniform vec2 size;                  /* of the plane */
uniform vec3 polar;                 /* largest angle, largest that is looked up, 1: the whole sphere */
uniform float scale;
uniform int surfaceKind;            /* 0 infinitely far, 1 ball, 2 box */
uniform vec3 surfaceCentre;
uniform mat3 surfaceMap;
uniform int lampCount;

uniform int mode;                   /* what a pixel is; see direction() */
uniform vec3 at;                    /* the point that is looked from */
uniform mat3 eye;                   /* columns: right, up, forward */
uniform vec4 lens;                  /* half width and half height of the picture at distance 1; its size in pixels */
uniform int lamp;                   /* of modes 6 and 7 */
uniform vec4 cone;                  /* of mode 6: 1 - cos of its half angle; samples along a side */
uniform int asked;                  /* 0 radiance, 1 where the ray meets the surface */

const float PI = 3.14159265358979;

/* ---- probes ---- */

vec3 texel(int k)
{
    return scale * texelFetch(probes, ivec2(k & ((1 << shift) - 1), k >> shift), 0).rgb;
}

vec3 texelRow(int base, int y, int x0, int x1, float a)
{
    int k = base + y * grid.z;
    return mix(texel(k + x0), texel(k + x1), a);
}

vec3 lookup(int probe, vec3 e)
{
    float r = length(e.xy);
    float theta = r > 0. ? atan(e.y, e.x) : 0., phi = min(atan(r, e.z), polar.y);
    float x = (theta + PI) * float(grid.z) / (2. * PI) - .5, y = phi * float(grid.w) / polar.x - .5;
    float a = x - floor(x), last = float(grid.w - 1);
    int x0 = (int(floor(x)) + grid.z) % grid.z, x1 = (x0 + 1) % grid.z;
    int pole = grid.z * grid.w, base = probe * (pole + 2);

    if (y < 0.) return mix(texel(base + pole), texelRow(base, 0, x0, x1, a), 1. + 2. * y);
    if (y >= last) {
        vec3 low = texelRow(base, grid.w - 1, x0, x1, a);
        return polar.z > 0. ? mix(low, texel(base + pole + 1), clamp(2. * (y - last), 0., 1.)) : low;
    }
    int y0 = int(y);
    return mix(texelRow(base, y0, x0, x1, a), texelRow(base, y0 + 1, x0, x1, a), y - float(y0));
}

/* ---- auxiliary geometry ---- */

/* Distance to where a ray leaves the surface; below 0: it does not meet it. */
float leaves(vec3 o, vec3 d)
{
    vec3 p = surfaceMap * (o - surfaceCentre), q = surfaceMap * d;

    if (surfaceKind == 1) {
        float A = dot(q, q), B = dot(p, q), C = dot(p, p) - 1., D = B * B - A * C;
        return D < 0. ? -1. : (-B + sqrt(D)) / A;
    }
    vec3 lo = (-1. - p) / q, hi = (1. - p) / q;
    vec3 first = min(lo, hi), then = max(lo, hi);
    bvec3 flat_ = lessThan(abs(q), vec3(1e-12));
    for (int k = 0; k < 3; k++)
        if (flat_[k]) first[k] = abs(p[k]) > 1. ? 1e30 : -1e30, then[k] = 1e30;
    float enters = max(first.x, max(first.y, first.z)), t = min(then.x, min(then.y, then.z));
    return enters > t ? -1. : t;
}

/* Where it meets the surface; false: infinitely far away. */
bool meets(out vec3 h, vec3 o, vec3 d)
{
    float t = surfaceKind == 0 ? -1. : leaves(o, d);

    h = o + t * d;
    return t > 0.;
}

/* ---- four probes ---- */

vec3 node(int i, int j)
{
    return vec3(grid.x > 1 ? size.x * float(i) / float(grid.x - 1) : size.x / 2.,
                grid.y > 1 ? size.y * float(j) / float(grid.y - 1) : size.y / 2., 0.);
}

vec3 oneProbe(int i, int j, float w, vec3 d, vec3 h, bool deep)
{
    vec3 e = h - node(i, j);

    if (w == 0.) return vec3(0.);
    return w * lookup(j * grid.x + i, deep && dot(e, e) > 0. ? e : d);
}

/* What the probes hold of a ray that comes from h (from infinity: through h). */
vec3 rest(vec3 d, vec3 h, bool deep)
{
    vec2 p = h.xy - d.xy * (h.z / d.z), most = vec2(grid.xy - 1);
    vec2 s = clamp(p / size * most, vec2(0.), most);
    ivec2 i = ivec2(min(floor(s), max(most - 1., 0.))), i1 = min(i + 1, grid.xy - 1);
    vec2 a = s - vec2(i);

    return oneProbe(i.x, i.y, (1. - a.x) * (1. - a.y), d, h, deep) + oneProbe(i1.x, i.y, a.x * (1. - a.y), d, h, deep) +
           oneProbe(i.x, i1.y, (1. - a.x) * a.y, d, h, deep) + oneProbe(i1.x, i1.y, a.x * a.y, d, h, deep);
}

/* ---- lamps: their rows are FORMAT.md's, number 20 the first mask of a lamp, the first sample of a mask's picture ---- */

vec4 row(int k, int part)
{
    int t = 6 * k + part;
    return texelFetch(rows, ivec2(t & 2047, t >> 11), 0);
}

float hitBall(vec3 e, float radius, vec3 d)
{
    float m = dot(e, d);
    vec3 x = e - m * d;
    float q = radius * radius - dot(x, x);

    return q > 0. && m - sqrt(q) > 0. ? m - sqrt(q) : -1.;
}

float hitTube(vec3 e, vec3 a, float radius, vec3 d)
{
    float aa = dot(a, a), ad = dot(a, d), ae = -dot(a, e), A = aa - ad * ad, s = 0.;
    float B = aa * -dot(e, d) - ae * ad, C = aa * (dot(e, e) - radius * radius) - ae * ae, h = B * B - A * C;

    if (A > 0.) {
        if (h < 0.) return -1.;
        float t = (-B - sqrt(h)) / A;
        s = ae + t * ad;
        if (abs(s) <= aa) return t > 0. ? t : -1.;
    }
    return hitBall(e + (s < 0. ? -a : a), radius, d);
}

float hitFlat(vec3 e, vec3 a, vec3 b, bool disc, vec3 d)
{
    vec3 m = cross(a, b);
    float dm = dot(d, m), t = dm != 0. ? dot(e, m) / dm : -1.;
    vec3 q = t * d - e;
    float x = dot(q, a) / dot(a, a), y = dot(q, b) / dot(b, b);

    return t > 0. && (disc ? x * x + y * y <= 1. : abs(x) <= 1. && abs(y) <= 1.) ? t : -1.;
}

/* Distance to lamp k; below 0: not met, or put out. */
float hitLamp(int k, vec3 o, vec3 d, float reach)
{
    vec4 r0 = row(k, 0), r1 = row(k, 1), r2 = row(k, 2), r3 = row(k, 3);
    vec3 e = vec3(r0.zw, r1.x) - o, a = r1.yzw, b = r2.xyz;
    int shape = int(r0.x);
    float t = shape == 0 ? hitBall(e, r2.w, d) : shape == 3 ? hitTube(e, a, r2.w, d) : hitFlat(e, a, b, shape == 2, d);

    return r3.xyz == vec3(0.) || (r0.y == 0. && t > reach) ? -1. : t;
}

float sampled(int begins, ivec2 n, vec4 place, vec2 f)
{
    vec2 s = clamp((f - place.xy) / place.zw, vec2(0.), vec2(n - 1));
    ivec2 i = ivec2(min(floor(s), vec2(max(n - 2, 0)))), i1 = min(i + 1, n - 1);
    vec2 a = s - vec2(i);
    int k[4] = int[4](i.y * n.x + i.x, i.y * n.x + i1.x, i1.y * n.x + i.x, i1.y * n.x + i1.x);
    float v[4];

    for (int c = 0; c < 4; c++) {
        int at_ = begins + k[c];
        v[c] = texelFetch(pictures, ivec2(at_ & ((1 << pictureShift) - 1), at_ >> pictureShift), 0).r;
    }
    return mix(mix(v[0], v[1], a.x), mix(v[2], v[3], a.x), a.y);
}

float logistic(float g)
{
    return 1. / (1. + exp(clamp(-g, -80., 80.)));
}

vec2 foot(float beta, vec3 c, vec3 o, vec3 d)
{
    vec2 p = o.xy - d.xy * (o.z / d.z), q = o.xy + d.xy * ((c.z - o.z) / d.z);
    return p + beta * (q - c.xy);
}

float passStack(int begins, ivec2 n, int nz, vec4 place, vec2 heights, vec2 coef, vec3 c, vec3 o, vec3 d)
{
    float most = 0.;

    for (int k = 0; k < nz; k++) {
        float tau = nz > 1 ? float(k) / float(nz - 1) : 0., h = 1. / ((1. - tau) / heights.x + tau / heights.y);
        if (o.z < h && h < c.z) most = max(most, sampled(begins + k * n.x * n.y, n, place, foot(h / (c.z - h), c, o, d)));
    }
    return logistic((coef.x - most) / coef.y);
}

float passBall(vec3 m, float radius, vec3 c, vec3 o, vec3 d)
{
    vec3 e = m - o;
    float t = dot(e, d);

    return t > 0. && t < (c.z - o.z) / d.z && dot(e, e) - t * t < radius * radius ? 0. : 1.;
}

float passMask(int k, vec3 c, vec3 o, vec3 d)
{
    vec4 r0 = row(k, 0), r1 = row(k, 1), r2 = row(k, 2), r3 = row(k, 3), r4 = row(k, 4), r5 = row(k, 5);
    int kind = int(r0.x), begins = int(r5.x);
    ivec2 n = ivec2(r3.yz);
    vec2 f = vec2(0.);

    if (kind == 2) {
        f = foot(r0.w, c, o, d);
        return logistic(r1.w + r2.x * f.x + r2.y * f.y + r2.z * f.x * f.x + r2.w * f.x * f.y + r3.x * f.y * f.y);
    }
    if (kind == 3) {
        float along = -dot(d, vec3(r1.w, r2.xy));
        return r2.w * (along > 0. ? pow(along, r2.z) : r2.z == 0. ? 1. : 0.);
    }
    if (kind == 4) return passStack(begins, n, int(r3.w), r4, r1.xy, vec2(r1.w, r2.x), c, o, d);
    if (kind == 5) return passBall(vec3(r1.w, r2.xy), r2.z, c, o, d);
    if (kind == 0) {
        float gap = r1.x + r1.y * o.x + r1.z * o.y - o.z, rise = d.z - r1.y * d.x - r1.z * d.y;
        if (gap <= 0. || rise <= 0.) return 1.;
        vec3 X = o + gap / rise * d;
        if (X.z >= c.z) return 1.;
        f = X.xy;
    } else f = foot(r0.w, c, o, d);
    float v = sampled(begins, n, r4, f);
    return r0.y > 0. ? logistic(v) : v;
}

float passLamp(int k, vec3 o, vec3 d)
{
    vec4 r0 = row(k, 0), r1 = row(k, 1);
    vec3 c = vec3(r0.zw, r1.x);
    int n = int(row(k, 3).w), first = lampCount + int(row(k, 5).x);
    float product = 1., sum = 0.;

    for (int m = first; m < first + n; m++) {
        float v = passMask(m, c, o, d);
        if (row(m, 0).z > 0.) sum += v;
        else product *= v;
    }
    return max(0., product + sum);
}

/* ---- a ray ---- */

/* Radiance from d; `only`: of this lamp beyond what the probes hold (-1: of all, with it; -2: of none). */
vec3 radiance(vec3 o, vec3 d, int only)
{
    vec3 h, light;
    bool deep = meets(h, o, d);
    int first = -1;
    float nearest = 1e38;

    if (d.z <= 0.) return vec3(0.);
    if (!deep) h = o;
    light = rest(d, h, deep);
    if (only == -2) return light;
    vec3 start = deep ? o : h - d * (h.z / d.z);
    float reach = deep ? 1.01 * dot(h - start, d) : 1e38;
    for (int k = 0; k < lampCount; k++) {
        float t = hitLamp(k, start, d, reach);
        if (t > 0. && t < nearest) nearest = t, first = k;
    }
    if (first < 0 || (only >= 0 && first != only)) return only >= 0 ? vec3(0.) : light;
    float pass = passLamp(first, start, d);
    vec3 lit = pass * row(first, 3).xyz, behind = min(pass, 1.) * light;
    return only >= 0 ? lit - behind : lit + light - behind;
}

/* ---- pixels ---- */

/* The direction of a pixel (place: -1 to 1); 0: none there. */
vec3 direction(vec2 place)
{
    if (mode == 0) return normalize(eye * vec3(place * lens.xy, 1.));
    if (mode == 4) return eye[2];
    if (mode == 5) {
        float t = place.x * PI, p = (1. - place.y) * PI / 4.;
        return vec3(sin(p) * cos(t), sin(p) * sin(t), cos(p));
    }
    if (mode == 6) {
        float z = 1. - (place.x + 1.) / 2. * cone.x, r = sqrt(max(0., 1. - z * z)), t = PI * (place.y + 1.);
        return eye * vec3(r * cos(t), r * sin(t), z);
    }
    vec2 q = place * lens.xy;
    float r = length(q);
    if (r >= 1.) return vec3(0.);
    if (mode == 1) {
        float p = r * PI / 2.;
        return vec3(r > 0. ? sin(p) * q / r : vec2(0.), cos(p));
    }
    vec3 n = eye * vec3(q, -sqrt(1. - r * r));
    return mode == 3 ? n : reflect(eye[2], n);
}

/* Irradiance of a surface that faces n, from a map of 64 x 33 normals. */
vec3 mattLight(vec3 n)
{
    float x = (atan(n.y, n.x) + PI) / (2. * PI) * 64., y = acos(clamp(n.z, -1., 1.)) / PI * 32.;
    int x0 = int(x) & 63, x1 = (x0 + 1) & 63, y0 = min(int(y), 31);
    float a = x - floor(x), b = y - float(y0);

    return mix(mix(texelFetch(matt, ivec2(x0, y0), 0).rgb, texelFetch(matt, ivec2(x1, y0), 0).rgb, a),
               mix(texelFetch(matt, ivec2(x0, y0 + 1), 0).rgb, texelFetch(matt, ivec2(x1, y0 + 1), 0).rgb, a), b);
}

#ifdef VALUES
layout(location = 0) out uvec4 result;

void main()
{
    vec3 d = direction(2. * gl_FragCoord.xy / lens.zw - 1.), h;
    vec3 value = asked == 1 ? vec3(0.) : radiance(at, d, mode == 5 ? -2 : mode == 6 ? lamp : -1);
    bool met = meets(h, at, d);

    if (asked == 1) value = h;
    result = uvec4(floatBitsToUint(value), met ? 1u : 0u);
}
#else
out vec4 result;
uniform float gain;                 /* of colours as they are; */
uniform vec2 decades;               /* of false ones: log10 of the lowest luminance, and how many */
uniform int falseColour;
uniform vec3 ramp[9];

vec3 coloured(vec3 rgb)
{
    if (falseColour == 1) {
        float y = 179. * dot(rgb, vec3(.265, .670, .065));
        float at_ = y > 0. ? clamp((log(y) / log(10.) - decades.x) / decades.y, 0., 1.) * 8. : 0.;
        int k = min(int(at_), 7);
        return mix(ramp[k], ramp[k + 1], at_ - float(k));
    }
    vec3 v = clamp(rgb * gain, 0., 1.);
    return mix(12.92 * v, 1.055 * pow(max(v, vec3(1e-9)), vec3(1. / 2.4)) - .055, step(vec3(.0031308), v));
}

/* How much of a lamp's light comes to a place of the plane: towards its centre. */
vec3 visibility(vec2 place)
{
    vec4 r0 = row(lamp, 0), r1 = row(lamp, 1);
    vec3 o = vec3((place + 1.) / 2. * size, at.z), d = normalize(vec3(r0.zw, r1.x) - o);

    return vec3(d.z > 0. ? min(passLamp(lamp, o, d), 1.) : 0.);
}

void main()
{
    vec2 place = 2. * gl_FragCoord.xy / lens.zw - 1.;

    if (mode == 7) {
        result = vec4(visibility(place), 1.);
        return;
    }
    vec3 d = direction(place);
    if (d == vec3(0.)) result = vec4(0.);
    else if (mode == 3) result = vec4(coloured(mattLight(d) * .8 / PI), 1.);
    else if (d.z <= 0.) {
        float stripes = fract((gl_FragCoord.x + gl_FragCoord.y) / 14.);
        result = vec4(vec3(stripes < .12 ? .27 : .2), 1.);
    } else result = vec4(coloured(radiance(at, d, -1)), 1.);
}
#endif
