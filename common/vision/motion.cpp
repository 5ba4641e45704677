// motion.cpp - see motion.h.
#include "guard.hpp"

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <vector>

extern "C" {
#include "motion.h"
}

motion motion_chain(motion a, motion b)
{
    motion out;
    out.angle = a.angle + b.angle;
    motion_apply(&b, a.dx, a.dy, &out.dx, &out.dy);
    return out;
}

void motion_apply(const motion *m, double x, double y, double *mx, double *my)
{
    double c = std::cos(m->angle), s = std::sin(m->angle);
    *mx = c * x - s * y + m->dx;
    *my = s * x + c * y + m->dy;
}

// Centres at +1/2 keep their place when pixels are grouped; OpenCV's centres are whole numbers.
motion motion_scaled(motion m, double factor)
{
    double half = 0.5 * (factor - 1); // centre of the first large pixels' group
    double x, y;
    motion turn = {m.angle, 0, 0};
    motion_apply(&turn, half, half, &x, &y);
    return {m.angle, factor * m.dx + half - x, factor * m.dy + half - y};
}

namespace
{

enum { ROUNDS = 60, SMOOTH = 5 };
const double enough = 1e-5; // gain of the correlation at which a level ends

cv::Mat matrix_of(const motion &m)
{
    double c = std::cos(m.angle), s = std::sin(m.angle);
    return (cv::Mat_<float>(2, 3) << c, -s, m.dx, s, c, m.dy);
}

motion motion_of(const cv::Mat &w)
{
    return {std::atan2(w.at<float>(1, 0), w.at<float>(0, 0)), w.at<float>(0, 2), w.at<float>(1, 2)};
}

struct level {
    cv::Mat rest, moved;
    cv::Mat rest_seen, seen; // 255 where rest and moved have data
};

// To half the size; what has a part in something unseen is unseen.
cv::Mat half_seen(const cv::Mat &seen, cv::Size size)
{
    cv::Mat half;
    cv::resize(seen, half, size, 0, 0, cv::INTER_AREA);
    return half == 255;
}

std::vector<level> octaves(const level &finest, int n)
{
    std::vector<level> all{finest};
    while ((int)all.size() < n && all.back().rest.cols >= 64 && all.back().rest.rows >= 64) {
        const level &above = all.back();
        level half;
        cv::Size size(above.rest.cols / 2, above.rest.rows / 2);
        cv::Rect even(0, 0, 2 * size.width, 2 * size.height);
        cv::resize(above.rest(even), half.rest, size, 0, 0, cv::INTER_AREA);
        cv::resize(above.moved(even), half.moved, size, 0, 0, cv::INTER_AREA);
        half.seen = half_seen(above.seen(even), size);
        half.rest_seen = half_seen(above.rest_seen(even), size);
        all.push_back(half);
    }
    return all;
}

bool all_seen(const cv::Mat &seen)
{
    return cv::countNonZero(seen) == (int)seen.total();
}

// Where, in the moved picture's pixels, both have data if it has moved by w; ECC's blur reaches SMOOTH / 2
// pixels far, and what the codes are where there is none (white) has edges of its own.
cv::Mat seen_in_both(const level &l, const cv::Mat &w)
{
    if (all_seen(l.rest_seen) && all_seen(l.seen)) return l.seen;
    cv::Mat there;
    cv::warpAffine(l.rest_seen, there, w, l.seen.size(), cv::INTER_NEAREST, cv::BORDER_CONSTANT,
                   cv::Scalar(255));
    cv::erode(there & l.seen, there, cv::Mat::ones(SMOOTH, SMOOTH, CV_8U));
    return there;
}

// One level's refinement of m; as it was where it does not converge.
motion refined(const level &l, const motion &m)
{
    cv::Mat w = matrix_of(m), both = seen_in_both(l, w);
    try {
        cv::findTransformECC(
            l.rest, l.moved, w, cv::MOTION_EUCLIDEAN,
            cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, ROUNDS, enough), both, SMOOTH);
    } catch (const cv::Exception &x) {
        if (x.code != cv::Error::StsNoConv) throw;
        return m;
    }
    return motion_of(w);
}

double correlation(const cv::Mat &a, const cv::Mat &b, const cv::Mat &where)
{
    double c = cv::computeECC(a, b, where);
    return std::isfinite(c) ? c : 0;
}

// Correlations over the pixels that both motions leave in the picture.
void correlations(motion_found *out, const level &l)
{
    cv::Mat w = matrix_of(out->m), turned, there, both;
    const int how = cv::INTER_LINEAR | cv::WARP_INVERSE_MAP;
    cv::warpAffine(l.moved, turned, w, l.rest.size(), how);
    cv::warpAffine(l.seen, there, w, l.rest.size(), how);
    both = (there == 255) & l.seen & l.rest_seen;
    out->before = correlation(l.rest, l.moved, both);
    out->after = correlation(l.rest, turned, both);
    out->self = correlation(l.moved, turned, both);
}

} // namespace

int vision_motion(motion_found *out, const float *rest, const float *moved, const unsigned char *rest_seen,
                  const unsigned char *seen, int w, int h, int levels, errmsg *e)
{
    return vision::guarded(e, "aligning", [&] {
        level finest;
        finest.rest = cv::Mat(h, w, CV_32F, const_cast<float *>(rest));
        finest.moved = cv::Mat(h, w, CV_32F, const_cast<float *>(moved));
        auto mask = [&](const unsigned char *s) {
            cv::Mat all(h, w, CV_8U, cv::Scalar(255));
            if (s) all = cv::Mat(h, w, CV_8U, const_cast<unsigned char *>(s)) != 0;
            return all;
        };
        finest.rest_seen = mask(rest_seen);
        finest.seen = mask(seen);
        std::vector<level> all = octaves(finest, levels);
        motion_found found = {{0, 0, 0}, 0, 0, 1};
        for (size_t i = all.size(); i-- > 0;) {
            found.m = refined(all[i], found.m);
            if (i > 0) found.m = motion_scaled(found.m, 2);
        }
        correlations(&found, finest);
        if (!(found.after > found.before)) found = {{0, 0, 0}, found.before, found.before, 1};
        *out = found;
        return 0;
    });
}
