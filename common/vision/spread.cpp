// spread.cpp - see spread.h.
#include "guard.hpp"

#include <opencv2/imgproc.hpp>

extern "C" {
#include "spread.h"
}

namespace
{

const double most_sd = 8; // of a Gaussian on the copy that it is computed on
enum { MARGIN = 16 };     // pixels of darkness around that copy, so that its edge can be interpolated

void blur(const cv::Mat &from, cv::Mat &to, double sd)
{
    int reach = 2 * (int)(4 * sd + .5) + 1;
    cv::GaussianBlur(from, to, cv::Size(reach, reach), sd, sd, cv::BORDER_CONSTANT);
}

// Means over k x k pixels, the picture made whole with darkness.
cv::Mat smaller(const cv::Mat &g, int k)
{
    int w = (g.cols + k - 1) / k, h = (g.rows + k - 1) / k;
    cv::Mat whole, small;
    cv::copyMakeBorder(g, whole, 0, h * k - g.rows, 0, w * k - g.cols, cv::BORDER_CONSTANT);
    cv::resize(whole, small, cv::Size(w, h), 0, 0, cv::INTER_AREA);
    cv::copyMakeBorder(small, small, MARGIN, MARGIN, MARGIN, MARGIN, cv::BORDER_CONSTANT);
    return small;
}

} // namespace

int vision_spread(float *out, const float *g, int w, int h, double sd, errmsg *e)
{
    return vision::guarded(e, "spreading light", [&] {
        cv::Mat from(h, w, CV_32F, const_cast<float *>(g)), to(h, w, CV_32F, out);
        int k = 1;
        while (sd / k > most_sd) k *= 2;
        if (k == 1) {
            blur(from, to, sd);
            return 0;
        }
        cv::Mat small = smaller(from, k);
        blur(small, small, sd / k);
        // the middle of pixel x lies at (x + 1/2) / k of the copy, whose middles are at + 1/2
        double at = .5 / k - .5 + MARGIN;
        cv::Mat place = (cv::Mat_<double>(2, 3) << 1. / k, 0, at, 0, 1. / k, at);
        cv::warpAffine(small, to, place, to.size(), cv::INTER_LINEAR | cv::WARP_INVERSE_MAP,
                       cv::BORDER_REPLICATE);
        return 0;
    });
}

int vision_spots(int *label, const unsigned char *bright, int w, int h, int apart, errmsg *e)
{
    return vision::guarded(e, "telling spots apart", [&] {
        cv::Mat mask(h, w, CV_8U, const_cast<unsigned char *>(bright)), wide, to(h, w, CV_32S, label);
        cv::Mat disc = cv::getStructuringElement(cv::MORPH_ELLIPSE, cv::Size(2 * apart + 1, 2 * apart + 1));
        cv::dilate(mask != 0, wide, disc);
        return cv::connectedComponents(wide, to, 8, CV_32S) - 1;
    });
}
