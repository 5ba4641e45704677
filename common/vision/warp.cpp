// warp.cpp - see warp.h.
#include "guard.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

extern "C" {
#include "warp.h"
}

namespace
{

// the least part of a clipped code that makes the result clipped: below, it is within a code of the other
const float part = 1.f / 512;

cv::Mat affine(const motion &m)
{
    double c = std::cos(m.angle), s = std::sin(m.angle);
    return (cv::Mat_<double>(2, 3) << c, -s, m.dx, s, c, m.dy);
}

void to_light(cv::Mat &light, cv::Mat &clipped, const cv::Mat &codes, const warp_opts &o)
{
    codes.convertTo(light, CV_32F);
    if (!o.linear) cv::multiply(light, light, light);
    clipped.create(codes.size(), CV_32FC(codes.channels()));
    for (int y = 0; y < codes.rows; y++) {
        const uint16_t *z = codes.ptr<uint16_t>(y);
        float *to = clipped.ptr<float>(y);
        for (int i = 0; i < codes.cols * codes.channels(); i++)
            to[i] = z[i] >= o.clip[i % codes.channels()] ? 1.f : 0.f;
    }
}

// Values of `light` at the moved places, by a cubic kernel, but none beyond the four pixels around: a lamp
// has no dark ring.
cv::Mat at_places(const cv::Mat &light, const cv::Mat &w, cv::Size size)
{
    const int flags = cv::WARP_INVERSE_MAP;
    cv::Mat there, low, high, bound;
    cv::warpAffine(light, there, w, size, cv::INTER_CUBIC | flags, cv::BORDER_REPLICATE);
    cv::Mat square = cv::Mat::ones(2, 2, CV_8U);
    cv::erode(light, low, square, cv::Point(0, 0), 1, cv::BORDER_REPLICATE);
    cv::dilate(light, high, square, cv::Point(0, 0), 1, cv::BORDER_REPLICATE);
    cv::Mat corner = w.clone(); // of the four pixels: the nearest to half a pixel less is the floor
    corner.at<double>(0, 2) -= .5;
    corner.at<double>(1, 2) -= .5;
    cv::warpAffine(low, bound, corner, size, cv::INTER_NEAREST | flags, cv::BORDER_REPLICATE);
    cv::max(there, bound, there);
    cv::warpAffine(high, bound, corner, size, cv::INTER_NEAREST | flags, cv::BORDER_REPLICATE);
    cv::min(there, bound, there);
    return there;
}

void to_codes(cv::Mat codes, const cv::Mat &light, const cv::Mat &clipped, const warp_opts &o)
{
    int ch = codes.channels();
    for (int y = 0; y < codes.rows; y++) {
        const float *v = light.ptr<float>(y), *c = clipped.ptr<float>(y);
        uint16_t *to = codes.ptr<uint16_t>(y);
        for (int i = 0; i < codes.cols * ch; i++) {
            float z = (o.linear ? v[i] : std::sqrt(v[i] > 0 ? v[i] : 0)) + .5f;
            int code = z > 0 ? (int)z : 0, clip = o.clip[i % ch];
            // what no clipped code has a part in stays below the clip level
            to[i] = (uint16_t)(c[i] > part ? clip : code < clip ? code : clip - 1);
        }
    }
}

enum { BAND = 32 }; // rows at a time, so that the floats stay small

// First and last source row that rows [y, y + rows) of the result look at.
cv::Range source_rows(const motion &m, int width, int height, int y, int rows)
{
    double least = height, most = 0, mx, my;
    for (int corner = 0; corner < 4; corner++) {
        motion_apply(&m, corner & 1 ? width - 1 : 0, corner & 2 ? y + rows - 1 : y, &mx, &my);
        least = std::min(least, my);
        most = std::max(most, my);
    }
    int first = (int)std::floor(std::clamp(least - 4, 0., height - 1.));
    int last = (int)std::ceil(std::clamp(most + 4, 0., height - 1.));
    return cv::Range(first, last + 1);
}

// One plane (or all channels in step) from `in` to `out`, views of the caller's memory.
void warp_plane(cv::Mat out, cv::Mat seen, const cv::Mat &in, const motion &m, const warp_opts &o)
{
    const int how = cv::INTER_LINEAR | cv::WARP_INVERSE_MAP;
    double most_x = in.cols - .5, most_y = in.rows - .5, c = std::cos(m.angle), s = std::sin(m.angle);
    for (int y0 = 0; y0 < in.rows; y0 += BAND) {
        int rows = std::min<int>(BAND, in.rows - y0);
        cv::Range from = source_rows(m, in.cols, in.rows, y0, rows);
        motion here = m; // from the band's first row to the source rows' first
        motion_apply(&m, 0, y0, &here.dx, &here.dy);
        here.dy -= from.start;
        cv::Mat light, clipped, light_there, clipped_there, w = affine(here);
        to_light(light, clipped, in.rowRange(from), o);
        cv::Size size(in.cols, rows);
        light_there = at_places(light, w, size);
        cv::warpAffine(clipped, clipped_there, w, size, how, cv::BORDER_REPLICATE);
        for (int y = y0; y < y0 + rows; y++) {
            uint8_t *there = seen.ptr<uint8_t>(y);
            double mx, my;
            motion_apply(&m, 0, y, &mx, &my);
            for (int x = 0; x < in.cols; x++, mx += c, my += s)
                there[x] = mx >= -.5 && my >= -.5 && mx <= most_x && my <= most_y;
        }
        to_codes(out.rowRange(y0, y0 + rows), light_there, clipped_there, o);
    }
}

// A mosaic's planes of one colour, each at half the size: pixel p of plane (ox, oy) is pixel 2p + o of the
// picture.
void warp_mosaic(uint16_t *out, uint8_t *seen, const uint16_t *in, const motion &m, const warp_opts &o)
{
    for (int oy = 0; oy < 2; oy++)
        for (int ox = 0; ox < 2; ox++) {
            int w = (o.width - ox + 1) / 2, h = (o.height - oy + 1) / 2;
            if (w < 1 || h < 1) continue;
            cv::Mat from(h, w, CV_16U), to(h, w, CV_16U), there(h, w, CV_8U);
            double x, y;
            motion turn = {m.angle, 0, 0};
            motion_apply(&turn, ox, oy, &x, &y);
            motion half = {m.angle, (m.dx + x - ox) / 2, (m.dy + y - oy) / 2};
            for (int i = 0; i < h; i++)
                for (int k = 0; k < w; k++)
                    from.at<uint16_t>(i, k) =
                        in[(size_t)(2 * i + oy) * (size_t)o.width + (size_t)(2 * k + ox)];
            warp_opts plane = o;
            plane.clip[0] = o.clip[2 * oy + ox];
            warp_plane(to, there, from, half, plane);
            for (int i = 0; i < h; i++)
                for (int k = 0; k < w; k++) {
                    size_t at = (size_t)(2 * i + oy) * (size_t)o.width + (size_t)(2 * k + ox);
                    out[at] = to.at<uint16_t>(i, k);
                    seen[at] = there.at<uint8_t>(i, k);
                }
        }
}

} // namespace

int vision_warp(uint16_t *out, uint8_t *seen, const uint16_t *in, const motion *m, const warp_opts *o,
                errmsg *e)
{
    return vision::guarded(e, "aligning", [&] {
        if (o->mosaic) {
            warp_mosaic(out, seen, in, *m, *o);
            return 0;
        }
        int type = CV_16UC(o->channels);
        cv::Mat from(o->height, o->width, type, const_cast<uint16_t *>(in)),
            to(o->height, o->width, type, out);
        warp_plane(to, cv::Mat(o->height, o->width, CV_8U, seen), from, *m, *o);
        return 0;
    });
}
