/*
 * ilf_digest.c - one number that tells two light fields apart.
 *
 * It is taken from the values that lookups see, as float32 in probe order, so that neither the file's name
 * and date nor type, compression and order of its texels play a part: half values are the floats that they
 * stand for.  All of them count, for a change of a single texel is a change of light; the cost is one look
 * through the file, as a sampler takes.  Lamps that were taken out of the texels count as the file has them.
 *
 * Two chains of h <- (h ^ word) * K, h ^= h >> 32 (each step is invertible, so that a difference never
 * vanishes within a chain), joined and finished as in MurmurHash3's fmix64.  It guards against mistakes, not
 * against forgery.
 */
#include "ilf_lampfile.h"

static uint64_t chain(uint64_t h, uint64_t word)
{
    h = (h ^ word) * UINT64_C(0x9e3779b97f4a7c15);
    return h ^ h >> 32;
}

static uint64_t finish(uint64_t h)
{
    h = (h ^ h >> 33) * UINT64_C(0xff51afd7ed558ccd);
    h = (h ^ h >> 33) * UINT64_C(0xc4ceb9fe1a85ec53);
    return h ^ h >> 33;
}

/* A float's bits, with one zero only. */
static uint64_t bits(float v)
{
    uint32_t u;

    memcpy(&u, &v, sizeof u);
    return u == 0x80000000u ? 0 : u;
}

static void probe_digest(uint64_t h[2], const ilf *f, const unsigned char *pix)
{
    uint64_t a = h[0], b = h[1];

    for (int y = 0; y < f->info.n_phi; y++, pix += f->row_bytes)
        for (int x = 0; x < f->info.n_theta; x++) {
            const unsigned char *p = pix + (size_t)x * f->pixel_bytes;

            a = chain(a, bits(ilf_texel(f, p + f->chan_offset[0])) << 32 |
                             bits(ilf_texel(f, p + f->chan_offset[1])));
            b = chain(b, bits(ilf_texel(f, p + f->chan_offset[2])));
        }
    h[0] = a;
    h[1] = b;
}

static void row_digest(uint64_t h[2], const float row[ROW_NUMBERS])
{
    for (int k = 0; k < ROW_NUMBERS; k++) h[k & 1] = chain(h[k & 1], bits(row[k]));
}

/* What lamps shine, and what their masks let through; not how sure they are. */
static void lamps_digest(uint64_t h[2], const ilf *f)
{
    float row[ROW_NUMBERS];

    for (int i = 0; i < f->n_lamps; i++) {
        ilf_luminaire lamp = f->lamps[i];
        lamp.error_masks = lamp.error_interpolation = lamp.error_position = lamp.error_radiance = 0;
        ilf_lamp_to_row(row, &lamp);
        row_digest(h, row);
        for (int k = 0; k < lamp.nmasks; k++) {
            const int64_t n = ilf_mask_samples(&lamp.masks[k]);
            ilf_mask_to_row(row, &lamp.masks[k]);
            row_digest(h, row);
            for (int64_t s = 0; s < n; s++) h[s & 1] = chain(h[s & 1], bits(lamp.masks[k].grid[s]));
        }
    }
}

ilf_status ilf_digest(uint64_t *digest, const ilf *f, ilf_error *err)
{
    uint64_t h[2] = {0, 0};
    const int size[4] = {f->info.n_u, f->info.n_v, f->info.n_theta, f->info.n_phi};

    for (int k = 0; k < 4; k++) h[k & 1] = chain(h[k & 1], (uint64_t)size[k]);
    ilf_read_ahead(f);
    h[0] = chain(h[0], bits((float)f->info.polar_max));
    h[1] = chain(h[1], bits((float)f->info.polar_valid));
    for (int64_t k = 0; k < (int64_t)f->info.n_u * f->info.n_v; k++) {
        const unsigned char *pix;
        void *own;
        const ilf_status st = ilf_peek_probe(f, k, &pix, &own, err);

        if (st != ILF_OK) return st;
        probe_digest(h, f, pix);
        ilf_unpeek_probe(f, pix, own);
    }
    lamps_digest(h, f);
    *digest = finish(h[0] ^ finish(h[1]));
    return ILF_OK;
}
