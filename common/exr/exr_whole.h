/*
 * exr_whole.h - a chunk that compression did not make smaller is stored as it is.
 *
 * OpenEXR's core library (3.1) stores a chunk as compressed also when its compressed size comes out equal to
 * its raw size; readers take a chunk of the raw size as raw, and return garbage.
 */
#ifndef EXR_WHOLE_H
#define EXR_WHOLE_H

#include <openexr.h>
#include <string.h>

typedef exr_result_t exr_compress_fn(exr_encode_pipeline_t *pipe);

/* The pipeline's user data points to its original function. */
static inline exr_result_t exr_compress_or_keep(exr_encode_pipeline_t *pipe)
{
    exr_compress_fn *const *compress = (exr_compress_fn *const *)pipe->encoding_user_data;
    const exr_result_t r = (*compress)(pipe);

    if (r != EXR_ERR_SUCCESS || pipe->compressed_buffer == pipe->packed_buffer) return r;
    if (pipe->compressed_bytes >= pipe->packed_bytes && pipe->compressed_alloc_size >= pipe->packed_bytes) {
        memcpy(pipe->compressed_buffer, pipe->packed_buffer, pipe->packed_bytes);
        pipe->compressed_bytes = pipe->packed_bytes;
    }
    return r;
}

/* Call after exr_encoding_choose_default_routines; *kept lives as long as the pipeline is run. */
static inline void exr_keep_incompressible(exr_encode_pipeline_t *pipe, exr_compress_fn **kept)
{
    if (!pipe->compress_fn) return;
    *kept = pipe->compress_fn;
    pipe->encoding_user_data = kept;
    pipe->compress_fn = exr_compress_or_keep;
}

#endif
