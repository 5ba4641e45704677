// circles.cpp - smaller and softer copies, and Hough's circles (circles.h).
#include "guard.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

extern "C" {
#include "circles.h"
}

namespace
{

// 8 bits between the 1st and the 99th percentile, as HoughCircles asks.
cv::Mat to_bytes(const cv::Mat &g)
{
    std::vector<float> some;
    size_t step = g.total() / 10000 + 1;
    for (size_t i = 0; i < g.total(); i += step) some.push_back(g.ptr<float>()[i]);
    std::sort(some.begin(), some.end());
    float lo = some[some.size() / 100], hi = some[some.size() - 1 - some.size() / 100],
          range = std::max(hi - lo, 1e-6f);
    cv::Mat out;
    g.convertTo(out, CV_8U, 255 / range, -lo * 255 / range);
    return out;
}

} // namespace

int vision_reduce(float *out, int ow, int oh, const float *g, int w, int h, errmsg *e)
{
    return vision::guarded(e, "smaller copy", [&] {
        cv::Mat from(h, w, CV_32F, const_cast<float *>(g)), to(oh, ow, CV_32F, out);
        cv::resize(from, to, to.size(), 0, 0, cv::INTER_AREA);
        return 0;
    });
}

int vision_soften(float *g, int w, int h, double sd, errmsg *e)
{
    return vision::guarded(e, "softer copy", [&] {
        cv::Mat m(h, w, CV_32F, g);
        cv::GaussianBlur(m, m, cv::Size(0, 0), sd, sd, cv::BORDER_REPLICATE);
        return 0;
    });
}

int vision_circles(vision_circle *out, int room, const float *g, int w, int h, double r0, double r1,
                   errmsg *e)
{
    return vision::guarded(e, "circles", [&] {
        cv::Mat bytes = to_bytes(cv::Mat(h, w, CV_32F, const_cast<float *>(g))), soft;
        cv::GaussianBlur(bytes, soft, cv::Size(0, 0), 1.5);
        std::vector<cv::Vec3f> all;
        auto add = [&](int method, double high, double votes) {
            std::vector<cv::Vec3f> c;
            cv::HoughCircles(soft, c, method, 1.5, std::max(r0, 8.), high, votes, (int)std::floor(r0),
                             (int)std::ceil(r1));
            all.insert(all.end(), c.begin(), c.begin() + (long)std::min(c.size(), (size_t)room / 4));
        };
        for (double high : {300., 120., 60.}) add(cv::HOUGH_GRADIENT_ALT, high, 0.6);
        add(cv::HOUGH_GRADIENT, 80, std::max(20., 0.15 * std::min(w, h)));
        int n = std::min(room, (int)all.size());
        for (int k = 0; k < n; k++)
            out[k] = {all[(size_t)k][0] + 0.5, all[(size_t)k][1] + 0.5, all[(size_t)k][2]};
        return n;
    });
}
