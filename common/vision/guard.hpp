// guard.hpp - the border between OpenCV's C++ and our C.
//
// Every function of this folder has a C interface (X.h) and is implemented inside guarded(), so
// that no exception leaves it: cv::Exception, out of memory and anything else become one line in errmsg.
#ifndef VISION_GUARD_HPP
#define VISION_GUARD_HPP

#include <exception>
#include <new>
#include <opencv2/core.hpp>

extern "C" {
#include "base/errmsg.h"
extern int cli_threads; // cli.h, which is C11
}

namespace vision
{

// Runs work() (which returns 0, or -1 with *e set); what it throws ends as -1 with words.
// `what` names the job in the message.  OpenCV's threads are as many as --threads says.
template <typename Work> int guarded(errmsg *e, const char *what, Work work)
{
    try {
        if (cli_threads > 0) cv::setNumThreads(cli_threads);
        return work();
    } catch (const std::bad_alloc &) {
        return err_set(e, "%s: out of memory", what);
    } catch (const cv::Exception &x) {
        return err_set(e, "%s: OpenCV: %s", what, x.err.c_str());
    } catch (const std::exception &x) {
        return err_set(e, "%s: %s", what, x.what());
    }
}

} // namespace vision

#endif
