/*
 * image_exr_file.cpp - OpenEXR's C++ library behind image_exr.h's C interface; nothing is thrown beyond this
 * file.
 *
 * Scan lines go through InputPart, tiles (the first level) through TiledInputPart a row of tiles at a time,
 * luminance and chroma through RgbaInputFile, which has the filter that brings RY and BY to every pixel.
 */
#include <ImfChannelList.h>
#include <ImfChromaticitiesAttribute.h>
#include <ImfDoubleAttribute.h>
#include <ImfEnvmapAttribute.h>
#include <ImfFloatAttribute.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputPart.h>
#include <ImfIntAttribute.h>
#include <ImfMultiPartInputFile.h>
#include <ImfPartType.h>
#include <ImfRgbaFile.h>
#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>
#include <ImfStringVectorAttribute.h>
#include <ImfTileDescription.h>
#include <ImfTiledInputPart.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <unistd.h>
#include <vector>

#include "image_exr.h"

using namespace Imf;

namespace
{

/* The open file, by position: its name may be gone, and its offset is shared. */
class fd_stream : public IStream
{
  public:
    fd_stream(int fd, uint64_t bytes) : IStream("the file"), fd_(fd), bytes_(bytes)
    {
    }

    bool read(char c[], int n) override
    {
        if (n < 0 || at_ > bytes_ || (uint64_t)n > bytes_ - at_)
            throw std::runtime_error("the file ends too early");
        for (size_t left = (size_t)n, got; left > 0; c += got, left -= got, at_ += got) {
            if (at_ < first_ || at_ >= first_ + have_) {
                if (left >= sizeof buf_) { /* to its place at once */
                    got = some(c, left);
                    continue;
                }
                first_ = at_;
                have_ = some(buf_, sizeof buf_);
            }
            got = std::min(left, (size_t)(first_ + have_ - at_));
            memcpy(c, buf_ + (at_ - first_), got);
        }
        return at_ < bytes_;
    }
    uint64_t tellg() override
    {
        return at_;
    }
    void seekg(uint64_t pos) override
    {
        at_ = pos;
    }

  private:
    /* At least one byte from where we are. */
    size_t some(char *to, size_t size)
    {
        for (;;) {
            const ssize_t n = pread(fd_, to, size, (off_t)at_);
            if (n < 0 && errno == EINTR) continue;
            if (n < 0) throw std::runtime_error(strerror(errno));
            if (n == 0) throw std::runtime_error("the file ends too early");
            return (size_t)n;
        }
    }
    int fd_;
    uint64_t bytes_, at_ = 0, first_ = 0;
    size_t have_ = 0;
    char buf_[1 << 14];
};

struct part_store {
    std::string name, view;
    std::vector<std::string> channel_names, view_names;
    std::vector<exr_channel> channels;
    std::vector<const char *> views;
    exr_part facts;
};

void keep(char *why, const char *words)
{
    snprintf(why, EXR_NAME, "%s", words);
}

/* Run something of the library's; its exceptions become words. */
template <class F> int guarded(char *why, F &&f)
{
    try {
        f();
        return 0;
    } catch (const std::bad_alloc &) {
        keep(why, "out of memory");
    } catch (const std::exception &x) {
        keep(why, x.what());
    } catch (...) {
        keep(why, "unknown failure");
    }
    return -1;
}

} // namespace

struct exr_file {
    exr_file(int fd, uint64_t bytes) : stream(fd, bytes), second(fd, bytes), in(stream, 0, false)
    {
    }

    fd_stream stream, second; /* the second for the RGBA interface, which opens the file for itself */
    MultiPartInputFile in;
    std::vector<std::unique_ptr<part_store>> parts;

    int part = 0, n = 0, lines = 1;
    std::vector<std::string> names;
    std::unique_ptr<InputPart> rows;
    std::unique_ptr<TiledInputPart> tiles;
    std::unique_ptr<RgbaInputFile> rgba;
    std::vector<Rgba> line;
};

namespace
{

void take_header(part_store &p, const Header &h, bool complete)
{
    if (h.hasName()) p.name = h.name();
    if (h.hasView()) p.view = h.view();
    if (const auto *v = h.findTypedAttribute<StringVectorAttribute>("multiView")) p.view_names = v->value();
    for (const std::string &v : p.view_names) p.views.push_back(v.c_str());
    for (auto c = h.channels().begin(); c != h.channels().end(); ++c) p.channel_names.push_back(c.name());
    for (const std::string &c : p.channel_names) {
        const Channel &x = *h.channels().findChannel(c);
        p.channels.push_back({c.c_str(), x.xSampling, x.ySampling});
    }
    exr_part &f = p.facts;
    memset(&f, 0, sizeof f);
    f.name = p.name.c_str(), f.view = p.view.c_str();
    f.complete = complete;
    f.deep = h.hasType() && !isImage(h.type());
    f.channels = (int)p.channels.size(), f.channel = p.channels.data();
    f.nviews = (int)p.views.size(), f.views = p.views.data();
    const Imath::Box2i *from[2] = {&h.dataWindow(), &h.displayWindow()};
    for (int k = 0; k < 2; k++) {
        int *to = k ? f.display : f.data;
        to[0] = from[k]->min.x, to[1] = from[k]->min.y, to[2] = from[k]->max.x, to[3] = from[k]->max.y;
    }
    f.pixel_aspect = h.pixelAspectRatio();
    f.envmap = hasEnvmap(h) ? (int)envmap(h) : -1;
    f.has_chroma = hasChromaticities(h);
    if (f.has_chroma) {
        const Chromaticities c = chromaticities(h);
        const Imath::V2f xy[4] = {c.red, c.green, c.blue, c.white};
        for (int k = 0; k < 4; k++) f.chroma[2 * k] = xy[k].x, f.chroma[2 * k + 1] = xy[k].y;
    }
    const auto *alpha = h.findTypedAttribute<StringAttribute>(EXR_STRAIGHT);
    f.straight_alpha = alpha && alpha->value() == EXR_STRAIGHT_VALUE;
}

} // namespace

extern "C" int exr_file_open(exr_file **out, int fd, int64_t bytes, char *why)
{
    exr_file *f = nullptr;
    const int rc = guarded(why, [&] {
        f = new exr_file(fd, (uint64_t)bytes);
        for (int k = 0; k < f->in.parts(); k++) {
            f->parts.push_back(std::make_unique<part_store>());
            take_header(*f->parts.back(), f->in.header(k), f->in.partComplete(k));
        }
    });
    if (rc) exr_file_close(f);
    else *out = f;
    return rc;
}

extern "C" void exr_file_close(exr_file *f)
{
    try {
        delete f;
    } catch (...) {
    }
}

extern "C" int exr_file_parts(const exr_file *f)
{
    return (int)f->parts.size();
}

extern "C" const exr_part *exr_file_part(const exr_file *f, int k)
{
    return &f->parts[(size_t)k]->facts;
}

/* ---- pixels ------------------------------------------------------------------------------------------ */

static int lines_together(const Header &h)
{
    switch (h.compression()) {
    case NO_COMPRESSION:
    case RLE_COMPRESSION:
    case ZIPS_COMPRESSION: return 1;
    case ZIP_COMPRESSION:
    case PXR24_COMPRESSION: return 16;
    case PIZ_COMPRESSION:
    case B44_COMPRESSION:
    case B44A_COMPRESSION:
    case DWAA_COMPRESSION: return 32;
    default: return 256;
    }
}

extern "C" int exr_file_pick(exr_file *f, int part, const char *const *names, int n, int luma, char *why)
{
    return guarded(why, [&] {
        const Header &h = f->in.header(part);
        const bool tiled = h.hasType() ? h.type() == TILEDIMAGE : h.hasTileDescription();
        f->part = part, f->n = n;
        f->names.assign(names, names + (luma ? 1 : n));
        if (luma) {
            f->rgba = std::make_unique<RgbaInputFile>(f->second, f->names[0]);
            f->line.resize((size_t)(h.dataWindow().max.x - h.dataWindow().min.x + 1));
            f->lines = 1;
        } else if (tiled) {
            f->tiles = std::make_unique<TiledInputPart>(f->in, part);
            const int64_t height = (int64_t)h.dataWindow().max.y - h.dataWindow().min.y + 1;
            f->lines = (int)std::min<int64_t>(f->tiles->tileYSize(), height);
        } else {
            f->rows = std::make_unique<InputPart>(f->in, part);
            f->lines = lines_together(h);
        }
    });
}

extern "C" int exr_file_lines(const exr_file *f)
{
    return f->lines;
}

/* Pixel (x, y) of channel k is at base + x·step + y·stride, for x and y of the file. */
static FrameBuffer buffer_for(const exr_file *f, float *rows, int x0, int y0, size_t width)
{
    FrameBuffer b;
    const size_t step = (size_t)f->n * sizeof(float), stride = width * step;
    const intptr_t back = (intptr_t)x0 * (intptr_t)step + (intptr_t)y0 * (intptr_t)stride;
    for (int k = 0; k < f->n; k++) {
        char *base = reinterpret_cast<char *>(reinterpret_cast<intptr_t>(rows + k) - back);
        b.insert(f->names[(size_t)k], Slice(FLOAT, base, step, stride));
    }
    return b;
}

static void luma_rows(exr_file *f, float *to, int x0, int y0, int y1)
{
    for (int y = y0; y <= y1; y++) {
        f->rgba->setFrameBuffer(f->line.data() - x0, 1, 0);
        f->rgba->readPixels(y, y);
        for (const Rgba &p : f->line) {
            const half v[4] = {p.r, p.g, p.b, p.a};
            for (int k = 0; k < f->n; k++) *to++ = v[k];
        }
    }
}

extern "C" int exr_file_rows(exr_file *f, float *rows, int y0, int y1, char *why)
{
    return guarded(why, [&] {
        const Imath::Box2i &w = f->in.header(f->part).dataWindow();
        if (f->rgba) {
            luma_rows(f, rows, w.min.x, y0, y1);
            return;
        }
        const FrameBuffer b = buffer_for(f, rows, w.min.x, y0, (size_t)((int64_t)w.max.x - w.min.x + 1));
        if (f->rows) {
            f->rows->setFrameBuffer(b);
            f->rows->readPixels(y0, y1);
        } else {
            const int ty = (int)(((int64_t)y0 - w.min.y) / f->tiles->tileYSize());
            f->tiles->setFrameBuffer(b);
            f->tiles->readTiles(0, f->tiles->numXTiles() - 1, ty, ty);
        }
    });
}

/* ---- facts --------------------------------------------------------------------------------------------- */

extern "C" int exr_file_fact(const exr_file *f, int part, const char *name, char *text, size_t room)
{
    char why[EXR_NAME];
    int found = 0;
    guarded(why, [&] {
        const Header &h = f->in.header(part);
        found = 1;
        if (const auto *v = h.findTypedAttribute<FloatAttribute>(name))
            snprintf(text, room, "%.9g", (double)v->value());
        else if (const auto *d = h.findTypedAttribute<DoubleAttribute>(name))
            snprintf(text, room, "%.17g", d->value());
        else if (const auto *i = h.findTypedAttribute<IntAttribute>(name))
            snprintf(text, room, "%d", i->value());
        else if (const auto *s = h.findTypedAttribute<StringAttribute>(name))
            snprintf(text, room, "%s", s->value().c_str());
        else found = 0;
    });
    return found;
}
